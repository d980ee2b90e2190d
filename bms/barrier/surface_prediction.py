"""How cold the surface cannot be: a check of the surface sensor by the heat of the current.

Core and surface obey a stable, positive linear system that heat and coolant drive. Predicted from
the measured current and coolant temperature alone, the surface is off by no more than what
disturbance and sensors can do through that system, and because the system is positive its static
gains bound every history. A reading below the prediction by more is a sensor that is stuck, drifts
or has come off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.bus_signals import BUS, BusQuantisation
from bms.cell import CellParameters
from bms.errors import InputError
from bms.presets.schema import Preset


@dataclass(frozen=True)
class SurfacePrediction:
    """One period of the prediction: transition (2, 2), gains (2,), bound on the surface's error.

    States are core and surface temperature above any fixed one, inputs heat in W and the coolant
    temperature above the same one.
    """

    transition: Array
    gain_K_per_W: Array
    gain_coolant: Array
    ohmic_resistance_ohm: float
    entropic_coefficient_V_per_K: float
    error_bound_K: float


def surface_prediction(
    cell: CellParameters, preset: Preset, bus: BusQuantisation = BUS
) -> SurfacePrediction:
    """Exact discretisation for the preset's period, inputs held, of the cell's two-mass model.

    The bound covers the preset's disturbances, the errors of the current, coolant and surface
    sensors and of the bus, for a cell that was at rest when the prediction began. Of a family it is
    the coldest cell that is predicted. Raises InputError for a cell that the entropic heat alone
    would run away with.
    """
    # Imported here, so that an ECU with the compiled-in constants starts without SciPy.
    from scipy.linalg import expm  # noqa: PLC0415

    bound_K = None
    if cell.interval is not None:
        from bms.barrier.family_surface import coldest_cell, family_error_bound_K  # noqa: PLC0415

        bound_K, cell = family_error_bound_K(preset), coldest_cell(preset)
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    augmented = np.zeros((4, 4))
    augmented[0] = [-1.0 / (rc * cc), 1.0 / (rc * cc), 1.0 / cc, 0.0]
    augmented[1] = [1.0 / (rc * cs), -1.0 / (rc * cs) - 1.0 / (rs * cs), 0.0, 1.0 / (rs * cs)]
    discrete = expm(augmented * preset.timing.sampling_period_s)
    return SurfacePrediction(
        discrete[:2, :2],
        discrete[:2, 2],
        discrete[:2, 3],
        cell.ohmic_resistance_ohm,
        cell.entropic_coefficient_V_per_K,
        _error_bound_K(cell, preset, bus) if bound_K is None else bound_K,
    )


def _error_bound_K(cell: CellParameters, preset: Preset, bus: BusQuantisation) -> float:
    sensors, bounds = preset.sensors, preset.uncertainty
    current_A = -preset.limits.reference_current_A
    current_error_A = sensors.current_A.error_bound + bus.current_A
    coolant_error_K = sensors.coolant_temperature_K.error_bound + bus.coolant_temperature_K
    surface_error_K = sensors.surface_temperature_K.error_bound + bus.surface_temperature_K
    entropic = abs(cell.entropic_coefficient_V_per_K)
    heat_per_A = (
        2.0 * cell.ohmic_resistance_ohm * (current_A + current_error_A)
        + entropic * preset.limits.max_core_temperature_K
    )
    heat_error_W = (
        heat_per_A * current_error_A
        + cell.core_heat_capacity_J_per_K * bounds.core_K_per_s
        + cell.surface_heat_capacity_J_per_K * bounds.surface_K_per_s
    )
    # The entropic heat depends on the core temperature, which heat and resistances set in turn.
    loop = entropic * current_A * (cell.core_resistance_K_per_W + cell.surface_resistance_K_per_W)
    if loop >= 1.0:
        raise InputError(
            f"preset '{preset.name}': cell.entropic_coefficient_V_per_K: {entropic:g} V/K heats "
            "more than the resistances carry away to the coolant; check it and the resistances"
        )
    at_start_and_now = 2.0 * surface_error_K
    driven_K = cell.surface_resistance_K_per_W * heat_error_W + coolant_error_K
    return float((driven_K + at_start_and_now) / (1.0 - loop))
