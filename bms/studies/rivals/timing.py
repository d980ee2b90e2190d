"""Measured time per estimate."""

from __future__ import annotations

from collections.abc import Callable
from statistics import median

from bms.studies.rivals.estimator import Estimator, Sequences

Clock = Callable[[], int]
"""Nanoseconds since any moment; it must not run backwards."""

REPEATS = 101
_ROWS = 2**14


def time_per_estimate_ns(estimator: Estimator, data: Sequences, clock_ns: Clock) -> float:
    """Median of several runs over whole profiles with about 16,000 samples, in ns per sample.

    The first run, which fills the caches, does not count.
    """
    short = data.head(_ROWS)
    inputs = short.of_columns(estimator.columns)
    estimator.estimate(inputs, short.starts)
    runs = []
    for _ in range(REPEATS):
        begin_ns = clock_ns()
        estimator.estimate(inputs, short.starts)
        runs.append((clock_ns() - begin_ns) / len(inputs))
    return median(runs)
