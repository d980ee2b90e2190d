"""What sampling, delay, sensors, the bus and float32 subtract from the four constraints.

A command computed from a measurement at time t acts until t + h, h = control period + delay. If
each left-hand side can fall by no more than its margin within h, and by no more through
measurement errors, then a decision that leaves at least the margin keeps the continuous-time
condition at every instant between samples. This is the method of Breeden, Garg and Panagou 2021
(Theorem 3) applied to the constraint itself; docs/theory.md has the derivation.

What `bms verify` takes off again is computed here too: the charge that a hold brings, the counting
error, and what arithmetic and bus take from a decision.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.barrier.constants import barrier_constants
from bms.barrier.rates import Weights, largest_rate
from bms.barrier.readings import reading_errors, soc_error_bound, soc_reserve
from bms.barrier.rounding import CONSTANT_ROUNDINGS, ROUNDINGS, UNIT, rounding_allowances
from bms.bus_signals import BUS, BusQuantisation
from bms.cell import CellParameters
from bms.decision import ConstraintMargins
from bms.presets.schema import Preset


@dataclass(frozen=True)
class Margins:
    """Subtracted from the left-hand sides of the voltage, SoC, core and surface constraints."""

    voltage_V: Any
    soc_per_s: Any
    core_K_per_s: Any
    surface_K_per_s2: Any


def strongest_current_A(preset: Preset, bus: BusQuantisation) -> float:
    """Largest charging current that can flow (A, positive): the reference as rounded."""
    return -preset.limits.reference_current_A * (1.0 + UNIT) + bus.command_A


def charge_taken_up(
    cell: CellParameters, preset: Preset, bus: BusQuantisation, current_A: Any
) -> Any:
    """State of charge that comes in from a reading until the current decided by it ends.

    Any current flows before the decision acts, the decided one, current_A (positive), after that.
    The latest possible begin is the worst, because no current is above the strongest.
    """
    timing = preset.timing
    charge_As = timing.delay_s * strongest_current_A(preset, bus) + (
        timing.sampling_period_s * current_A
    )
    held_s = timing.sampling_period_s + timing.delay_s
    return charge_As / cell.capacity_As + held_s * preset.uncertainty.soc_per_s


def decision_allowances(
    cell: CellParameters, preset: Preset, bus: BusQuantisation, roundings: int = ROUNDINGS
) -> ConstraintMargins:
    """What each left-hand side can be below zero at the current that flows (V, 1/s, K/s, K/s^2).

    The decision rounds, and the bus may ask for a little more than was decided.
    """
    a, limits = barrier_constants(cell, preset), preset.limits
    current_A = strongest_current_A(preset, bus)
    hottest_K = max(preset.operating_box.surface_temperature_K[1], limits.max_core_temperature_K)
    per_A = (
        cell.ohmic_resistance_ohm,
        1.0 / cell.capacity_As,
        np.abs(a.a2_per_As) * hottest_K + 2.0 * a.a3_K_per_A2s * current_A,
        np.abs(a.a8_per_As2) * hottest_K + 2.0 * np.abs(a.a9_K_per_A2s2) * current_A,
    )
    rounded = rounding_allowances(cell, preset, roundings)
    return ConstraintMargins(
        *(allowance + slope * bus.command_A for allowance, slope in zip(rounded, per_A))
    )


def sampling_margins(cell: CellParameters, preset: Preset, bus: BusQuantisation = BUS) -> Margins:
    """Margins for a cell with the timing, sensors and limits of a preset (V, 1/s, K/s, K/s^2)."""
    constants = barrier_constants(cell, preset)
    current_A = -preset.limits.reference_current_A
    held_s = preset.timing.sampling_period_s + preset.timing.delay_s
    core_gain = preset.gains.core_gain_per_s(cell)
    errors, allowances = reading_errors(preset, bus), decision_allowances(cell, preset, bus)
    reserve = soc_reserve(cell, preset, bus)
    soc_change = (
        soc_error_bound(cell, preset, bus)
        - reserve
        + charge_taken_up(cell, preset, bus, strongest_current_A(preset, bus))
    )

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
    return Margins(
        voltage_V=_plain(
            _voltage_rise_V(cell, preset, bus, reserve, soc_change) + allowances.voltage_V
        ),
        soc_per_s=_plain(preset.gains.alpha1_per_s * soc_change + allowances.soc_per_s),
        core_K_per_s=_plain(
            held_s * core_fall + constants.a1_per_s * errors.surface_K + allowances.core_K_per_s
        ),
        surface_K_per_s2=_plain(
            held_s * surface_fall
            + np.abs(constants.a5_per_s2) * errors.surface_K
            + np.abs(constants.a6_per_s2) * errors.coolant_K
            + constants.a10_K_per_Ws2 * errors.cooling_W
            + allowances.surface_K_per_s2
        ),
    )


def _voltage_rise_V(
    cell: CellParameters, preset: Preset, bus: BusQuantisation, reserve: Any, soc_change: Any
) -> Any:
    """Largest rise of the open-circuit voltage by a charge, where the voltage limits the current.

    It does from where the strongest current would exceed the limit at the end of the hold, up to
    where the cell rests at the limit or is complete, with the reserve beyond what is counted. The
    table as the firmware has it, in float32, lies a little aside, and ends where it is full.
    """
    limits = preset.limits
    soc_change = soc_change + CONSTANT_ROUNDINGS * UNIT
    free_V = limits.max_voltage_V - cell.ohmic_resistance_ohm * strongest_current_A(preset, bus)
    first_soc = np.where(
        free_V >= cell.ocv.voltage_V[-1], np.inf, cell.ocv.soc_at(free_V) - soc_change
    )
    last_soc = np.minimum(cell.ocv.soc_at(limits.max_voltage_V), limits.completion_soc + reserve)
    within_V = cell.ocv.largest_rise_V(soc_change, np.maximum(first_soc, 0.0), last_soc)
    end_soc = cell.ocv.soc[-1]
    beyond = np.maximum(limits.completion_soc + reserve - end_soc, 0.0)
    beyond_V = cell.ocv(end_soc + beyond + soc_change) - cell.ocv(end_soc)
    return np.where(beyond > 0.0, np.maximum(within_V, beyond_V), within_V)


def _plain(value: Any) -> Any:
    """A float where the parameters were numbers, an array where they were arrays."""
    return float(np.squeeze(value)) if np.size(value) == 1 else value
