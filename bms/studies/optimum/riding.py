"""Charges that can be had: a wanted current, or as much as the limits leave of it.

Played with the cell model itself, true state known, no solver and no relaxation; so their times lie
above the bound of any correct proof, and close above where both are good.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.cell import CellState, at_rest_V
from bms.cell.integrator import integrate_step
from bms.cell.model import ohmic_resistance_ohm, terminal_voltage_V
from bms.cell.polarisation import polarisation_after_V, polarisation_heat_W
from bms.studies.optimum.bound import LONGEST_S, Bound
from bms.studies.optimum.charge import Charge
from bms.studies.optimum.ranges import map_current_A

STEP_S = 0.2
_APPROACH_PER_S = 1.0
"""Rate at which the core may come up to its limit."""
_CANDIDATES = 24
_ROUNDING = 1e-6


Wanted = Callable[[float], Array]
"""Wanted currents (N,) in A at a time in s."""


@dataclass(frozen=True)
class Riding:
    """The best of a family of charges: its factor, and the time in s at which the cell is full."""

    factor: float
    time_s: float


def best_constant(charge: Charge, step_s: float = STEP_S) -> Riding | None:
    """Fastest charge of a constant current, then riding; the factor is its current in A.

    None where no such charge keeps all limits.
    """
    return _best(charge, lambda time_s: 1.0, 0.1 * charge.strongest_A, charge.strongest_A, step_s)


def best_following(charge: Charge, bound: Bound, step_s: float = STEP_S) -> Riding | None:
    """Fastest charge that follows a bound's current times a factor near 1; None as above."""
    middle_s = bound.time_s * (np.arange(bound.samples) + 0.5) / bound.samples

    def profile_A(time_s: float) -> float:
        return float(np.interp(time_s, middle_s, bound.current_A))

    return _best(charge, profile_A, 0.9, 1.1, step_s)


def _best(
    charge: Charge, shape: Callable[[float], float], low: float, high: float, step_s: float
) -> Riding | None:
    """Two rounds over the factor, the second between the neighbours of the first one's best."""
    best = None
    for _ in range(2):
        factors = np.linspace(low, high, _CANDIDATES)
        times_s = _times_of(charge, shape, factors, step_s)
        first = int(np.argmin(times_s))
        if not np.isfinite(times_s[first]):
            break
        if best is None or times_s[first] < best.time_s:
            best = Riding(float(factors[first]), float(times_s[first]))
        low, high = factors[max(first - 1, 0)], factors[min(first + 1, _CANDIDATES - 1)]
    return best


def _times_of(
    charge: Charge, shape: Callable[[float], float], factors: Array, step_s: float
) -> Array:
    return ride(charge, lambda time_s: factors * shape(time_s), len(factors), step_s)


def ride(charge: Charge, wanted: Wanted, count: int, step_s: float = STEP_S) -> Array:
    """Times to full (count,) in s of wanted currents, infinite where a limit is crossed."""
    cell, limits = charge.cell, charge.limits
    state = CellState(np.full(count, charge.start_soc), *np.full((3, count), charge.start_K))
    polarisation_V = tuple(np.full(count, volt) for volt in at_rest_V(cell))
    times_s, kept = np.full(count, np.inf), np.ones(count, dtype=bool)
    current_A = np.zeros(count)
    for number in range(int(LONGEST_S / step_s)):
        current_A = _allowed_A(
            charge, state, polarisation_V, wanted(number * step_s), current_A, step_s
        )
        after = integrate_step(
            cell, state, -current_A, charge.cooling_W, step_s, polarisation_V=polarisation_V
        )
        polarisation_V = polarisation_after_V(cell, polarisation_V, -current_A, step_s)
        voltage_V = terminal_voltage_V(
            cell, after.soc, -current_A, after.core_temperature_K, polarisation_V
        )
        charging = ~np.isfinite(times_s)
        kept &= ~charging | (
            (after.core_temperature_K <= limits.max_core_temperature_K + _ROUNDING)
            & (after.surface_temperature_K <= limits.max_surface_temperature_K + _ROUNDING)
            & (voltage_V <= limits.max_voltage_V + _ROUNDING)
        )
        full = charging & (after.soc >= limits.completion_soc)
        part = (limits.completion_soc - state.soc) / np.maximum(after.soc - state.soc, 1e-15)
        times_s = np.where(full, (number + part) * step_s, times_s)
        state = after
        if np.all(np.isfinite(times_s) | ~kept):
            break
    return np.where(kept, times_s, np.inf)


def _allowed_A(
    charge: Charge,
    state: CellState,
    polarisation_V: tuple[Array, ...],
    wanted_A: Array,
    before_A: Array,
    step_s: float,
) -> Array:
    """Strongest current of each charge that keeps every limit to the end of the step, about."""
    cell, limits = charge.cell, charge.limits
    soc, core_K, surface_K, _ = state
    current_A = np.minimum(wanted_A, charge.strongest_A)
    if charge.growth_A_per_s is not None:
        current_A = np.minimum(current_A, before_A + charge.growth_A_per_s * step_s)
    if charge.current_map is not None:
        fullest = soc + current_A * step_s / cell.capacity_As
        current_A = np.minimum(current_A, map_current_A(charge.current_map, surface_K, fullest))
    ohm = ohmic_resistance_ohm(cell, core_K, soc)
    entropic = cell.entropic_coefficient_V_per_K if cell.entropy is None else cell.entropy(soc)
    room_W = (core_K - surface_K) / cell.core_resistance_K_per_W
    room_W = room_W + _APPROACH_PER_S * cell.core_heat_capacity_J_per_K * (
        limits.max_core_temperature_K - core_K
    )
    room_W = np.maximum(room_W - polarisation_heat_W(cell, polarisation_V), 0.0)
    half_V = 0.5 * entropic * core_K
    current_A = np.minimum(current_A, (np.sqrt(half_V**2 + ohm * room_W) - half_V) / ohm)
    # The open-circuit voltage and the branches as they are at the end, at the current so far.
    fullest = soc + current_A * step_s / cell.capacity_As
    later_V = polarisation_after_V(cell, polarisation_V, -current_A, step_s)
    room_V = limits.max_voltage_V - cell.ocv(fullest) - sum(later_V)
    later_ohm = ohmic_resistance_ohm(cell, core_K, fullest)
    current_A = np.minimum(current_A, room_V / np.maximum(later_ohm, ohm))
    allowed_A: Array = np.maximum(current_A, 0.0)
    return allowed_A
