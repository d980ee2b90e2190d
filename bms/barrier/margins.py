"""What sampling, delay, sensors, the bus and float32 subtract from the four constraints.

A command computed from a measurement at time t acts until t + h, h = control period + delay. If
each left-hand side can fall by no more than its margin within h, and by no more through
measurement errors, then a decision that leaves at least the margin keeps the continuous-time
condition at every instant between samples. This is the method of Breeden, Garg and Panagou 2021
(Theorem 3) applied to the constraint itself; docs/theory.md has the derivation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.barrier.constants import barrier_constants
from bms.barrier.rates import Weights, largest_rate
from bms.barrier.rounding import rounding_allowances
from bms.bus_signals import QUANTISATION, BusQuantisation
from bms.cell import CellParameters
from bms.presets.schema import Preset

COUNTING_HORIZON_S = 3600.0
"""Longest charge over which coulomb counting has to stay within its error bound."""


@dataclass(frozen=True)
class Margins:
    """Subtracted from the left-hand sides of the voltage, SoC, core and surface constraints."""

    voltage_V: Any
    soc_per_s: Any
    core_K_per_s: Any
    surface_K_per_s2: Any


def soc_error_bound(cell: CellParameters, preset: Preset, bus: BusQuantisation) -> float:
    """Bound on the counted state of charge: steady errors add up, noise grows as the root."""
    sensor = preset.sensors.current_A
    steady_A = abs(sensor.bias) + 0.5 * sensor.resolution + bus.current_A
    noise_As = (
        sensor.NOISE_CUTOFF
        * sensor.noise_std
        * float(np.sqrt(preset.timing.sampling_period_s * COUNTING_HORIZON_S))
    )
    return (
        steady_A * COUNTING_HORIZON_S + noise_As
    ) / cell.capacity_As + preset.uncertainty.soc_per_s * COUNTING_HORIZON_S


def sampling_margins(
    cell: CellParameters, preset: Preset, bus: BusQuantisation = QUANTISATION
) -> Margins:
    """Margins for a cell with the timing, sensors and limits of a preset (V, 1/s, K/s, K/s^2)."""
    constants = barrier_constants(cell, preset)
    sensors, limits = preset.sensors, preset.limits
    current_A = -limits.reference_current_A
    held_s = preset.timing.sampling_period_s + preset.timing.delay_s
    core_gain = preset.gains.core_gain_per_s(cell)

    soc_rate_per_s = current_A / cell.capacity_As + preset.uncertainty.soc_per_s
    soc_change = held_s * soc_rate_per_s + soc_error_bound(cell, preset, bus)
    upper_V, lower_soc = np.asarray(cell.ocv.voltage_V[1:]), np.asarray(cell.ocv.soc[:-1])
    near_limit = np.logical_and(
        upper_V[..., None] + current_A * cell.ohmic_resistance_ohm > limits.max_voltage_V,
        (lower_soc < limits.completion_soc + soc_change)[..., None],
    )
    steepest_V = np.max(np.where(near_limit, cell.ocv.slopes_V()[..., None], 0.0), axis=0)

    surface_error_K = sensors.surface_temperature_K.error_bound + bus.surface_temperature_K
    coolant_error_K = sensors.coolant_temperature_K.error_bound + bus.coolant_temperature_K
    cooling_error_W = sensors.cooling_power_W.error_bound + bus.cooling_power_W

    # How fast each left-hand side can fall at a held current; the terms with a product of core
    # temperature and current are bounded by the largest current, falling with a warming core.
    entropic_per_A = Weights(np.sign(cell.entropic_coefficient_V_per_K), 0.0, 0.0)
    coupling = largest_rate(cell, preset, entropic_per_A) * current_A
    core_fall = (
        largest_rate(cell, preset, Weights(core_gain - constants.a1_per_s, constants.a1_per_s, 0.0))
        + np.abs(constants.a2_per_As) * coupling
    )
    surface_fall = (
        largest_rate(
            cell,
            preset,
            Weights(-constants.a4_per_s2, -constants.a5_per_s2, -constants.a6_per_s2),
        )
        + np.abs(constants.a8_per_As2) * coupling
    )
    core_rounding, surface_rounding = rounding_allowances(cell, preset)
    return Margins(
        voltage_V=_plain(steepest_V * soc_change),
        soc_per_s=_plain(preset.gains.alpha1_per_s * soc_change),
        core_K_per_s=_plain(
            held_s * core_fall + constants.a1_per_s * surface_error_K + core_rounding
        ),
        surface_K_per_s2=_plain(
            held_s * surface_fall
            + np.abs(constants.a5_per_s2) * surface_error_K
            + np.abs(constants.a6_per_s2) * coolant_error_K
            + constants.a10_K_per_Ws2 * cooling_error_W
            + surface_rounding
        ),
    )


def _plain(value: Any) -> Any:
    """A float where the parameters were numbers, an array where they were arrays."""
    return float(np.squeeze(value)) if np.size(value) == 1 else value
