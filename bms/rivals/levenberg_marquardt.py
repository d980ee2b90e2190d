"""Levenberg-Marquardt for fits of few parameters to many samples.

SciPy's MINPACK does not give the same bits twice for the same problem, and small differences grow
over a thousand steps; this one does, and is quicker on thousands of rows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bms.kan.basis import Array

_FIRST_DAMPING, _SMALLEST_DAMPING, _LARGEST_DAMPING = 1e-3, 1e-12, 1e8
_SMALLER, _LARGER = 0.3, 4.0


def descended(
    residuals: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    start: Array,
    steps: int,
) -> Array:
    """Parameters (P,) with a smaller sum of squares after at most so many trial steps.

    `residuals` gives (N,) and `slopes` their derivatives (N, P) for parameters (P,).
    """
    values, left = start, residuals(start)
    square, damping = float(np.sum(left**2)), _FIRST_DAMPING
    normal = _normal_equations(slopes(values), left)
    damping *= float(np.trace(normal[:-1, :-1])) / len(start)
    for _ in range(steps):
        if damping > _LARGEST_DAMPING:
            break
        damped = normal[:-1, :-1] + damping * np.eye(len(values))
        tried = values - np.linalg.solve(damped, normal[:-1, -1])
        left = residuals(tried)
        tried_square = float(np.sum(left**2))
        # Not a number counts as a failure.
        if tried_square < square:
            values, square = tried, tried_square
            damping = max(_SMALLER * damping, _SMALLEST_DAMPING)
            normal = _normal_equations(slopes(values), left)
        else:
            damping *= _LARGER
    return values


def _normal_equations(slopes: Array, left: Array) -> Array:
    """J'J with J'r as its last column; one symmetric product, whose bits do not vary."""
    both = np.column_stack([slopes, left])
    return both.T @ both
