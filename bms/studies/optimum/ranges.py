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

_ROUNDS = 5
"""The ranges need each other; every round leaves them valid, and later ones change little."""
_PARTS = 4
"""Steps of the state of charge in a sample."""


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
    asked = np.full(samples, charge.strongest_A)
    if charge.growth_A_per_s is not None:
        end_s = step_s * np.arange(1, samples + 1)
        asked = np.minimum(asked, charge.growth_A_per_s * (end_s + charge.period_s))
    limits_K = charge.limits.max_core_temperature_K, charge.limits.max_surface_temperature_K
    core_K, surface_K = ((np.zeros(samples), np.full(samples, limit_K)) for limit_K in limits_K)
    everything = np.zeros(samples), np.full(samples, charge.limits.max_soc)
    resistance = _resistance(cell, core_K, everything)
    for _ in range(_ROUNDS):
        ceiling = Ceiling(charge, asked, surface_K[1], resistance[0])
        soc = _soc(charge, ceiling, step_s)
        strongest = np.array([ceiling(k, low) for k, low in enumerate(soc[0])])
        resistance = _resistance(cell, core_K, soc)
        entropic = _entropy(cell, soc)
        core_K, surface_K = _temperatures(charge, strongest, resistance, entropic, step_s)
    return Ranges(
        duration_s=duration_s,
        strongest_A=strongest,
        soc=soc,
        core_K=core_K,
        surface_K=surface_K,
        resistance_ohm=_resistance(cell, core_K, soc),
        entropic_V_per_K=entropic,
    )


class Ceiling:
    """Strongest current in A in a sample over the state of charge, which it never rises with.

    By what is asked for (N,), the voltage at the least resistance (N,), and the current map at the
    hottest surface (N,).
    """

    def __init__(self, charge: Charge, asked_A: Array, hottest_K: Array, least_ohm: Array) -> None:
        self.samples = len(asked_A)
        self._asked_A, self._least_ohm = asked_A, least_ohm
        self._most_V, self._ocv = charge.limits.max_voltage_V, charge.cell.ocv
        self._map_soc: tuple[float, ...] = ()
        if (table := charge.current_map) is not None:
            self._map_soc = table.soc
            columns = [
                map_current_A(table, hottest_K, np.full(len(hottest_K), soc)) for soc in table.soc
            ]
            self._map_A = np.column_stack(columns)

    def __call__(self, sample: int, soc: float) -> float:
        """Strongest current in A of a sample at a state of charge."""
        room_V = self._most_V - float(np.interp(soc, self._ocv.soc, self._ocv.voltage_V))
        most_A = min(float(self._asked_A[sample]), room_V / float(self._least_ohm[sample]))
        if self._map_soc:
            most_A = min(most_A, float(np.interp(soc, self._map_soc, self._map_A[sample])))
        return max(most_A, 0.0)


def _soc(charge: Charge, ceiling: Ceiling, step_s: float) -> tuple[Array, Array]:
    """From above by what can be charged until then, from below by what can be charged afterwards.

    As the ceiling never rises with the state of charge, no charge that begins a part at s or below
    ends it above s + part * ceiling(s). So the highest is followed forwards from the start; and
    backwards from full, s is too low where s + part * ceiling(s) falls short.
    """
    samples = ceiling.samples
    part = step_s / _PARTS / charge.cell.capacity_As
    high, low = np.zeros(samples), np.zeros(samples)
    soc = charge.start_soc
    for k in range(samples):
        for _ in range(_PARTS):
            soc += part * ceiling(k, soc)
        high[k] = min(soc, charge.limits.max_soc)
    soc = charge.limits.completion_soc
    for k in range(samples - 1, -1, -1):
        for _ in range(_PARTS):
            lowest = soc - part * ceiling(k, soc - part * charge.strongest_A)
            soc -= part * ceiling(k, lowest)
        low[k] = max(soc, charge.start_soc)
    # Where the duration is too short for any charge, a range is empty; keep it ordered.
    return np.minimum(low, high), high


def _temperatures(
    charge: Charge,
    strongest_A: Array,
    resistance: tuple[Array, Array],
    entropic: tuple[Array, Array],
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
    low, high = (_course(charge, heat_W, step_s) for heat_W in (least_W, most_W))
    # Rates of the temperatures follow the dynamics too, whose rows add up to 0: none of them comes
    # to exceed the largest at the beginning of a sample.
    heats = most_W[:, None] * charge.heating + charge.cooling
    fastest = np.max(high[:-1] @ charge.dynamics.T + heats, axis=1)
    rise_K = np.maximum(fastest, 0.0) * step_s
    core, surface = (
        (
            np.minimum(low[:-1, i], low[1:, i]),
            np.minimum(high[:-1, i] + rise_K, limit_K),
        )
        for i, limit_K in enumerate(
            (hottest_K, charge.limits.max_surface_temperature_K),
        )
    )
    return core, surface


def _course(charge: Charge, heat_W: Array, step_s: float) -> Array:
    """Temperatures (N + 1, 3) in K under a heat that is constant in each sample."""
    drive = np.zeros((5, 5))
    drive[:3, :3] = charge.dynamics
    drive[:3, 3], drive[:3, 4] = charge.heating, charge.cooling
    step = expm(drive * step_s)
    state = np.full((len(heat_W) + 1, 3), charge.start_K)
    for k, heat in enumerate(heat_W):
        state[k + 1] = step[:3, :3] @ state[k] + step[:3, 3] * heat + step[:3, 4]
    return state


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
    current_A: Array = rows[below, columns] * (1.0 - share) + rows[below + 1, columns] * share
    return current_A


def map_planes(
    table: CurrentMap, surface_K: tuple[float, float], soc: tuple[float, float]
) -> Array:
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
