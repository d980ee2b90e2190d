"""The range of grids in which a distance falls as the theorem says."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bms.bounds.record import Rate

_SLOPE_TOLERANCE = 1.0
_TINY = 1e-300


def local_exponents(grids: Sequence[int], distances_K: Sequence[float]) -> list[float]:
    """Exponent of the power of 1/G between each grid and the one after the next, (n - 2,)."""
    logs = np.log(np.maximum(distances_K, _TINY))
    rise = np.log(np.asarray(grids[2:]) / np.asarray(grids[:-2]))
    return list(((logs[:-2] - logs[2:]) / rise).tolist())


def fit_rate(grids: Sequence[int], distances_K: Sequence[float], order: int) -> Rate | None:
    """Rate over the longest run of grids whose every local exponent is at least the order less 1.

    None when there is no such run, which has three grids at least. M is the smallest number that
    bounds the distances of the run by M G^-order; the exponent is their least-squares slope.
    """
    holds = [e >= order - _SLOPE_TOLERANCE for e in local_exponents(grids, distances_K)]
    runs = [
        (first, last)
        for first in range(len(holds))
        for last in range(first, len(holds))
        if all(holds[first : last + 1])
    ]
    if not runs:
        return None
    first, last = max(runs, key=lambda run: run[1] - run[0])
    run = slice(first, last + 3)
    within = np.asarray(grids[run], dtype=np.float64)
    distances = np.maximum(distances_K[run], _TINY)
    slope = np.polyfit(np.log(within), np.log(distances), 1)[0]
    constant_K = float(np.max(distances * within**order))
    return Rate(int(within[0]), int(within[-1]), constant_K, float(-slope))
