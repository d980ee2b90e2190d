"""What is certain of any charge of a given duration: ranges of its state, sample by sample.

Everything here holds for every admitted current, so that a table may be replaced by its least value
over a range without a controller losing anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import expm
from scipy.spatial import ConvexHull

from bms.arrays import Array
from bms.cell import CellParameters
from bms.presets.schema import CurrentMap
from bms.studies.optimum.charge import Charge

_ROUNDS = 3
"""The ranges need each other; every round leaves them valid, and later ones change little."""


@dataclass(frozen=True)
class Ranges:
    """Bounds in each of N samples of a duration, arrays (N,); `low` and `high` are (N,) pairs."""

    duration_s: float
    strongest_A: Array
    soc: tuple[Array, Array]
    core_K: tuple[Array, Array]
    surface_K: tuple[Array, Array]
    resistance_ohm: tuple[Array, Array]
    entropic_V_per_K: tuple[Array, Array]

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return len(self.strongest_A)

    @property
    def step_s(self) -> float:
        """Length of a sample in s."""
        return self.duration_s / self.samples


def ranges_of(charge: Charge, duration_s: float, samples: int) -> Ranges:
    """Ranges of every charge that is full after duration_s."""
    cell, step_s = charge.cell, duration_s / samples
    end_s = step_s * np.arange(1, samples + 1)
    strongest = np.full(samples, charge.strongest_A)
    if charge.growth_A_per_s is not None:
        strongest = np.minimum(strongest, charge.growth_A_per_s * (end_s + charge.period_s))
    core_K = surface_K = (
        np.zeros(samples),
        np.full(samples, charge.limits.max_core_temperature_K),
    )
    for _ in range(_ROUNDS):
        soc = _soc(charge, strongest, step_s)
        resistance = _resistance(cell, core_K, soc)
        entropic = _entropy(cell, soc)
        core_K, surface_K = _temperatures(charge, strongest, resistance, entropic, core_K, step_s)
        strongest = np.minimum(strongest, _by_voltage(charge, soc, resistance))
        if charge.current_map is not None:
            strongest = np.minimum(
                strongest, map_current_A(charge.current_map, surface_K[1], soc[0])
            )
    soc = _soc(charge, strongest, step_s)
    return Ranges(
        duration_s=duration_s,
        strongest_A=strongest,
        soc=soc,
        core_K=core_K,
        surface_K=surface_K,
        resistance_ohm=_resistance(cell, core_K, soc),
        entropic_V_per_K=_entropy(cell, soc),
    )


def _soc(charge: Charge, strongest_A: Array, step_s: float) -> tuple[Array, Array]:
    """From above by what was charged at most, from below by what can still be charged at most."""
    parts = np.concatenate([[0.0], np.cumsum(strongest_A)]) * step_s / charge.cell.capacity_As
    highest = np.minimum(charge.start_soc + parts[1:], charge.limits.max_soc)
    left = parts[-1] - parts[:-1]
    lowest = np.maximum(charge.limits.completion_soc - left, charge.start_soc)
    # Where the duration is too short for any charge, the range is empty; keep it ordered.
    return np.minimum(lowest, highest), highest


def _temperatures(
    charge: Charge,
    strongest_A: Array,
    resistance: tuple[Array, Array],
    entropic: tuple[Array, Array],
    core_K: tuple[Array, Array],
    step_s: float,
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Core and surface between the coldest and the hottest charge; more heat never cools."""
    hottest_K = charge.limits.max_core_temperature_K
    least_V = np.minimum(entropic[0] * hottest_K, 0.0)
    least_W = -(least_V**2) / (4.0 * resistance[0])
    most_V = np.maximum(entropic[1] * hottest_K, 0.0)
    # A branch's voltage, and so its heat, stays below that of the strongest current.
    ohm = resistance[1] + sum(branch.resistance_ohm for branch in charge.cell.branches)
    strongest = np.maximum.accumulate(strongest_A)
    most_W = (ohm * strongest + most_V) * strongest
    low = _course(charge, least_W, charge.cooling, step_s)
    # Without cooling it only rises, so that its ends bound a sample.
    high = _course(charge, most_W, np.zeros(3), step_s)
    limits_K = (hottest_K, charge.limits.max_surface_temperature_K)
    core, surface = (
        (
            np.minimum(low[:-1, i], low[1:, i]),
            np.minimum(np.maximum(high[:-1, i], high[1:, i]), limit_K),
        )
        for i, limit_K in enumerate(limits_K)
    )
    return core, surface


def _course(charge: Charge, heat_W: Array, cooling: Array, step_s: float) -> Array:
    """Temperatures (N + 1, 3) in K under a heat that is constant in each sample."""
    drive = np.zeros((5, 5))
    drive[:3, :3] = charge.dynamics
    drive[:3, 3], drive[:3, 4] = charge.heating, cooling
    step = expm(drive * step_s)
    state = np.full((len(heat_W) + 1, 3), charge.start_K)
    for k, heat in enumerate(heat_W):
        state[k + 1] = step[:3, :3] @ state[k] + step[:3, 3] * heat + step[:3, 4]
    return state


def _by_voltage(
    charge: Charge, soc: tuple[Array, Array], resistance: tuple[Array, Array]
) -> Array:
    """Strongest current at the least open-circuit voltage, in A."""
    room_V = charge.limits.max_voltage_V - charge.cell.ocv(soc[0])
    return np.maximum(room_V, 0.0) / resistance[0]


def _resistance(
    cell: CellParameters, core_K: tuple[Array, Array], soc: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Least and greatest ohmic resistance over the ranges of a sample."""
    if cell.resistance is None:
        constant = np.full(len(soc[0]), cell.ohmic_resistance_ohm)
        return constant, constant
    table = cell.resistance
    values = [
        table(
            points_within(table.temperature_K, cold, hot)[:, None],
            points_within(table.soc, low, high)[None, :],
        )
        for cold, hot, low, high in zip(*core_K, *soc)
    ]
    return np.array([np.min(part) for part in values]), np.array([np.max(part) for part in values])


def _entropy(cell: CellParameters, soc: tuple[Array, Array]) -> tuple[Array, Array]:
    """Least and greatest dU/dT over the ranges of a sample."""
    if cell.entropy is None:
        constant = np.full(len(soc[0]), cell.entropic_coefficient_V_per_K)
        return constant, constant
    values = [cell.entropy(points_within(cell.entropy.soc, *ends)) for ends in zip(*soc)]
    return np.array([np.min(part) for part in values]), np.array([np.max(part) for part in values])


def points_within(axis: tuple[float, ...], low: float, high: float) -> Array:
    """Both ends and the points of an axis between them, rising: where a table has its extremes."""
    points = np.asarray(axis)
    return np.concatenate([[low], points[(points > low) & (points < high)], [high]])


def map_current_A(table: CurrentMap, temperature_K: Array, soc: Array) -> Array:
    """Current of a map in A, bilinear between its points, its edge beyond them."""
    rows = np.array([np.interp(soc, table.soc, row) for row in table.largest_A])
    temperatures = np.asarray(table.temperature_K)
    at = np.clip(temperature_K, temperatures[0], temperatures[-1])
    below = np.clip(np.searchsorted(temperatures, at, side="right") - 1, 0, len(temperatures) - 2)
    share = (at - temperatures[below]) / (temperatures[below + 1] - temperatures[below])
    columns = np.arange(len(at))
    return rows[below, columns] * (1.0 - share) + rows[below + 1, columns] * share


def map_planes(table: CurrentMap, surface_K: tuple[float, float], soc: tuple[float, float]) -> Array:
    """Planes (P, 3) whose least value is never below the map in a range: I <= a + b Ts + c soc.

    They are the upper concave envelope. A bilinear piece has the envelope of its corners, so that
    of the whole is the hull of the points of the map inside the range and on its border.
    """
    temperatures = points_within(table.temperature_K, *_wide(*surface_K))
    charges = points_within(table.soc, *_wide(*soc))
    grid = np.array([(t, s) for t in temperatures for s in charges])
    current_A = map_current_A(table, grid[:, 0], grid[:, 1])
    # Scaled, with a floor far below, so that only the upper facets point upwards.
    origin, spread = grid[0], grid[-1] - grid[0]
    unit = (grid - origin) / spread
    top = max(float(np.max(current_A)), 1e-9)
    corners = np.array([(x, y, -1.0) for x in (0.0, 1.0) for y in (0.0, 1.0)])
    hull = ConvexHull(np.vstack([np.column_stack([unit, current_A / top]), corners]))
    normals = hull.equations[hull.equations[:, 2] > 1e-9]
    slopes = -normals[:, :2] / normals[:, 2:3] * top / spread
    height = -normals[:, 3] / normals[:, 2] * top - slopes @ origin
    planes = np.column_stack([height, slopes])
    # No facet is below the map by the hull's rounding.
    lack = np.max(current_A[:, None] - (planes[:, 0] + grid @ slopes.T), axis=0)
    planes[:, 0] += np.maximum(lack, 0.0)
    _, first = np.unique(np.round(planes, 6), axis=0, return_index=True)
    return planes[first]


def _wide(low: float, high: float) -> tuple[float, float]:
    return low, max(high, low + 1e-3)


def voltage_lines(cell: CellParameters, soc: tuple[float, float]) -> Array:
    """Lines (P, 2) whose greatest value is the lower convex envelope of the open-circuit voltage.

    V >= a + b soc in the range; beyond it the last line goes on.
    """
    low, high = _wide(*soc)
    hull: list[tuple[float, float]] = []
    charges = points_within(cell.ocv.soc, low, high)
    for point in zip(charges.tolist(), cell.ocv(charges).tolist()):
        while len(hull) > 1 and _turns_down(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(hull)]
    return np.array([(a[1] - slope * a[0], slope) for a, slope in zip(hull, slopes)])


def _turns_down(
    first: tuple[float, float], middle: tuple[float, float], last: tuple[float, float]
) -> bool:
    return (middle[1] - first[1]) * (last[0] - middle[0]) >= (last[1] - middle[1]) * (
        middle[0] - first[0]
    )
