"""How far the surface and core of a cell of a spread can be from what the nominal model predicts.

Core and surface obey a stable, positive linear system that heat and coolant drive. What another
cell makes of the same heat is the integral of the difference of both impulse responses; what it
makes of the same coolant is that of both step responses, times the coolant's rate. The worst is
taken over the spread's corners.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from bms.arrays import Array
from bms.cell import CellParameters
from bms.presets import Preset
from hil_sim.studies.pack.spread import Spread

_STEP_S = 0.5
_SETTLED = 10.0  # time constants after which nothing is left of an impulse


@dataclass(frozen=True)
class Differences:
    """Bounds on a cell's temperature less the nominal prediction.

    `above_K_per_W` and `below_K_per_W` are for each watt of the greatest heat so far, which heats
    the coolant too; `falling_K_per_K_per_s` is for each K/s at which a coolant can fall.
    """

    above_K_per_W: float
    below_K_per_W: float
    falling_K_per_K_per_s: float


def surface_differences(preset: Preset, spread: Spread) -> Differences:
    """Of the surface."""
    return _differences(preset, spread, 1)


def core_differences(preset: Preset, spread: Spread) -> Differences:
    """Of the core."""
    return _differences(preset, spread, 0)


def _differences(preset: Preset, spread: Spread, mass: int) -> Differences:
    nominal = preset.cell
    corners = spread.corners(nominal)
    # Heat of the least heat capacity warms the coolant fastest; cooling only slows that.
    capacity_J_per_K = min(
        cell.core_heat_capacity_J_per_K
        + cell.surface_heat_capacity_J_per_K
        + cell.coolant_heat_capacity_J_per_K
        for cell in corners
    )
    own = _responses(nominal, nominal)
    above, below, falling = [], [], []
    for corner in corners:
        heat, coolant = (
            _STEP_S * (other[mass] - ours[mass])
            for other, ours in zip(_responses(corner, nominal), own)
        )
        above.append(_positive(heat) + _positive(coolant) / capacity_J_per_K)
        below.append(_positive(-heat) + _positive(-coolant) / capacity_J_per_K)
        falling.append(max(_positive(coolant), _positive(-coolant)))
    return Differences(max(above), max(below), max(falling))


def _positive(values: Array) -> float:
    return float(np.sum(np.maximum(values, 0.0)))


def _responses(cell: CellParameters, nominal: CellParameters) -> tuple[Array, Array]:
    """Core and surface, (2, n) every _STEP_S: after one joule in the core, and after the coolant
    became warmer by one kelvin.

    That to heat is a step's mean: exact for heats that are constant over each step.
    """
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    matrix = np.array(
        [[-1.0 / (rc * cc), 1.0 / (rc * cc)], [1.0 / (rc * cs), -(1.0 / rc + 1.0 / rs) / cs]]
    )
    longest_s = (nominal.core_resistance_K_per_W + nominal.surface_resistance_K_per_W) * (
        nominal.core_heat_capacity_J_per_K + nominal.surface_heat_capacity_J_per_K
    )
    step = expm(matrix * _STEP_S)
    held = np.linalg.solve(matrix, (step - np.eye(2)) @ np.array([1.0 / cc, 0.0])) / _STEP_S
    below = np.array([-1.0, -1.0])  # the coolant
    count = int(_SETTLED * longest_s / _STEP_S)
    heat, coolant = np.empty((2, count)), np.empty((2, count))
    for i in range(count):
        heat[:, i], coolant[:, i] = held, 1.0 + below
        held, below = step @ held, step @ below
    return heat, coolant
