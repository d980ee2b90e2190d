"""Heat of a cell between the rows of a recording: as a model has it, and as the voltage tells."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from scipy.optimize import least_squares

from bms.arrays import Array
from bms.cell import CellParameters
from bms.data.charge import counted_soc
from bms.data.measurements import Measurements
from bms.errors import InputError
from bms.identification.trajectory import thermal_trajectory

THERMAL = (
    "core_heat_capacity_J_per_K",
    "core_resistance_K_per_W",
    "surface_heat_capacity_J_per_K",
    "surface_resistance_K_per_W",
)
_LARGEST_FACTOR = 2.0
_REST_SHARE = 0.01
"""Of the largest current: with less in the first row, its voltage is the open-circuit one."""


def middle(values: Array) -> Array:
    """Mean of each row and the next, (N - 1,)."""
    middles: Array = 0.5 * (values[1:] + values[:-1])
    return middles


def assumed_heat_W(cell: CellParameters, recording: Measurements) -> Array:
    """R0 u^2 - E Tc u (N - 1,) by the cell's constants."""
    current_A = recording.current_A[:-1]
    entropic_V = cell.entropic_coefficient_V_per_K * middle(recording.core_temperature_K)
    heat_W: Array = (cell.ohmic_resistance_ohm * current_A - entropic_V) * current_A
    return heat_W


def measured_heat_W(cell: CellParameters, recording: Measurements, voltage_V: Array) -> Array:
    """u (Vo(soc) - V) - u Tc dU/dT(soc) (N - 1,): what the measured voltage (N,) tells.

    The charge counts from where the open-circuit voltage is the first voltage, which has to be at
    rest. Raises InputError when it is not. Source: Bernardi et al. 1985, general energy balance.
    """
    current_A = recording.current_A
    if abs(current_A[0]) > _REST_SHARE * np.max(np.abs(current_A)):
        raise InputError(
            f"begins with {current_A[0]:g} A, so that its first voltage does not tell the state of "
            "charge; begin the recording at rest"
        )
    start_soc = float(cell.ocv.soc_at(voltage_V[0]))
    soc = middle(counted_soc(cell, start_soc, recording.time_s, current_A))
    entropic_V_per_K = (
        cell.entropic_coefficient_V_per_K if cell.entropy is None else cell.entropy(soc)
    )
    reversible_V = middle(recording.core_temperature_K) * entropic_V_per_K
    heat_W: Array = current_A[:-1] * (cell.ocv(soc) - middle(voltage_V) - reversible_V)
    return heat_W


def fitted_to_heat(cell: CellParameters, recording: Measurements, heat_W: Array) -> CellParameters:
    """The cell with the two masses and resistances that fit a known heat (N - 1,) best.

    Known heat fixes the scale, which temperatures alone do not. Least squares on core and surface
    temperature from the first row on, each parameter at most a factor of 2 from the given cell's.
    """

    def scaled(logarithms: Array) -> CellParameters:
        factors = np.exp(logarithms).tolist()
        return dataclasses.replace(
            cell, **{name: getattr(cell, name) * factor for name, factor in zip(THERMAL, factors)}
        )

    def errors_K(logarithms: Array) -> Array:
        core_K, surface_K = thermal_trajectory(scaled(logarithms), recording, heat_W)
        return np.concatenate(
            [core_K - recording.core_temperature_K, surface_K - recording.surface_temperature_K]
        )

    reach = math.log(_LARGEST_FACTOR)
    found = least_squares(errors_K, np.zeros(len(THERMAL)), bounds=(-reach, reach))
    return scaled(found.x)
