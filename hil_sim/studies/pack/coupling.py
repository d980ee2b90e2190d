"""How far the surfaces of two neighbours can be apart, and what each then does to the other.

Both are cells of a spread that began at one temperature, under any one history of current.
docs/pack.md has the derivation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.cell import CellParameters
from bms.presets import Preset
from hil_sim.studies.pack.spread import Spread, Surroundings

_STEPS = 2000
"""In the longest time constant."""
_SETTLED = 10
"""Time constants after which nothing is left of an impulse."""


@dataclass(frozen=True)
class _Surface:
    """How a surface follows, at the ends of equal steps, with the loss to its neighbours.

    `heat_K_per_W` to a constant heat of the core, `own_K_per_W` to one of the surface, `around` to
    coolant and neighbours that both became warmer by 1 K.
    """

    heat_K_per_W: Array
    own_K_per_W: Array
    around: Array
    steady_K_per_W: float


def greatest_heat_W(preset: Preset, spread: Spread) -> float:
    """Heat of the cell with the greatest resistance at the strongest current, core at its limit."""
    cell, limits = preset.cell, preset.limits
    strength_A = -limits.reference_current_A
    reversible_V = max(0.0, cell.entropic_coefficient_V_per_K) * limits.max_core_temperature_K
    ohm = spread.resistance[1] * cell.ohmic_resistance_ohm
    return (ohm * strength_A + reversible_V) * strength_A


def falling_K_per_s(preset: Preset) -> float:
    """Rate at which the coolant of a cell falls at most."""
    most_W = preset.operating_box.cooling_power_W[1]
    return most_W / preset.cell.coolant_heat_capacity_J_per_K


def coupling_K_per_s(preset: Preset, spread: Spread, around: Surroundings) -> float:
    """Bound on the rate at which two neighbours change a cell's surface temperature."""
    gap_K = neighbour_gap_K(preset, spread, around)
    return 2.0 * around.neighbour_W_per_K * gap_K / preset.cell.surface_heat_capacity_J_per_K


def neighbour_gap_K(preset: Preset, spread: Spread, around: Surroundings) -> float:
    """Bound on the difference of two neighbours' surfaces at any instant of any charge."""
    cells = spread.corners(preset.cell)
    steps = np.arange(_SETTLED * _STEPS, dtype=np.float64)
    times_s = _longest_s(preset, spread) / _STEPS * steps
    surfaces = [_surface(cell, around.neighbour_W_per_K, times_s) for cell in cells]
    return max(_gap_K(preset, spread, around, hot, cold) for hot in surfaces for cold in surfaces)


def _gap_K(
    preset: Preset, spread: Spread, around: Surroundings, hot: _Surface, cold: _Surface
) -> float:
    """Of a cell that heats most and one that heats least."""
    most_W, k = greatest_heat_W(preset, spread), around.neighbour_W_per_K
    least = spread.resistance[0] / spread.resistance[1]
    uneven_K = most_W / around.flow_W_per_K
    cell, bounds = preset.cell, preset.uncertainty
    core_J_per_K = spread.core_heat_capacity[1] * cell.core_heat_capacity_J_per_K
    disturbing_W = (
        core_J_per_K * bounds.core_K_per_s
        + cell.surface_heat_capacity_J_per_K * bounds.surface_K_per_s
    )
    # Heat of the least capacity warms the coolant fastest; cooling only slows that.
    least_J_per_K = (
        spread.core_heat_capacity[0] * cell.core_heat_capacity_J_per_K
        + cell.surface_heat_capacity_J_per_K
        + cell.coolant_heat_capacity_J_per_K
    )
    lag_s = _longest_s(preset, spread) / _STEPS * (hot.around - cold.around)
    side = 2.0 * k * np.diff(hot.own_K_per_W - cold.own_K_per_W)
    slowest_K_per_W = spread.surface_resistance[1] * cell.surface_resistance_K_per_W
    above_coolant_K = slowest_K_per_W * (
        most_W + 2.0 * k * uneven_K + disturbing_W
    ) + falling_K_per_s(preset) * _longest_s(preset, spread)
    steady = hot.steady_K_per_W + cold.steady_K_per_W
    apart_K = (
        most_W * _positive(np.diff(hot.heat_K_per_W - least * cold.heat_K_per_W))
        + most_W / least_J_per_K * _positive(lag_s)
        + (falling_K_per_s(preset) + bounds.coolant_K_per_s) * _positive(-lag_s)
        + above_coolant_K * max(_positive(side), _positive(-side))
        + uneven_K
        + steady * disturbing_W
    )
    # Each has another neighbour too, from which it differs by no more.
    return float(apart_K / (1.0 - k * steady))


def _longest_s(preset: Preset, spread: Spread) -> float:
    """No cell of the spread is slower to come to rest with its coolant."""
    cell = preset.cell
    return (
        spread.core_resistance[1] * cell.core_resistance_K_per_W
        + spread.surface_resistance[1] * cell.surface_resistance_K_per_W
    ) * (
        spread.core_heat_capacity[1] * cell.core_heat_capacity_J_per_K
        + cell.surface_heat_capacity_J_per_K
    )


def _surface(cell: CellParameters, neighbour_W_per_K: float, times_s: Array) -> _Surface:
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    cs = cell.surface_heat_capacity_J_per_K
    loss_W_per_K = 1.0 / cell.surface_resistance_K_per_W + 2.0 * neighbour_W_per_K
    matrix = np.array(
        [[-1.0 / (rc * cc), 1.0 / (rc * cc)], [1.0 / (rc * cs), -(1.0 / rc + loss_W_per_K) / cs]]
    )
    # Both rates are real and differ, as of any two masses in a row.
    rates, vectors = np.linalg.eig(matrix)
    grown = np.expm1(np.outer(rates, times_s)) / rates[:, None]

    def follows(input_per_s: Array) -> Array:
        parts = np.linalg.solve(vectors, input_per_s)
        return np.asarray((vectors[1] * parts) @ grown)

    own = follows(np.array([0.0, 1.0 / cs]))
    heat = follows(np.array([1.0 / cc, 0.0]))
    return _Surface(heat, own, loss_W_per_K * own, 1.0 / loss_W_per_K)


def _positive(values: Array) -> float:
    return float(np.sum(np.maximum(values, 0.0)))
