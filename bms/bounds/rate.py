"""The range of grids in which a distance falls as the theorem says."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bms.bounds.record import Rate

_SLOPE_TOLERANCE = 1.0
_FEWEST_SLOPES = 2
_TINY = 1e-300


def local_exponents(grids: Sequence[int], distances_K: Sequence[float]) -> list[float]:
    """Exponent of the power of 1/G between each grid and the next, (n - 1,)."""
    logs = np.log(np.maximum(distances_K, _TINY))
    return list((-np.diff(logs) / np.diff(np.log(grids))).tolist())


def fit_rate(grids: Sequence[int], distances_K: Sequence[float], order: int) -> Rate | None:
    """Rate over the longest run of grids whose every local exponent is at least the order less 1.

    The run must hold three grids at least, or there is no rate (None). M is the smallest number
    that bounds the distances of the run by M G^-order; the exponent is their least-squares slope.
    """
    holds = [e >= order - _SLOPE_TOLERANCE for e in local_exponents(grids, distances_K)]
    runs = [
        (first, last)
        for first in range(len(holds))
        for last in range(first + _FEWEST_SLOPES, len(holds) + 1)
        if all(holds[first:last])
    ]
    if not runs:
        return None
    first, last = max(runs, key=lambda run: run[1] - run[0])
    within = np.asarray(grids[first : last + 1], dtype=np.float64)
    distances = np.asarray(distances_K[first : last + 1])
    slope = np.polyfit(np.log(within), np.log(distances), 1)[0]
    return Rate(grids[first], grids[last], float(np.max(distances * within**order)), float(-slope))
