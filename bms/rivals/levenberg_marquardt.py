"""Levenberg-Marquardt for fits of few parameters to many samples.

SciPy's MINPACK does not give the same bits twice for the same problem, and small differences grow
over a thousand steps; this one does.
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
    triangle = _triangle(slopes(values), left)
    for _ in range(steps):
        if damping > _LARGEST_DAMPING:
            break
        tried = values - _step(triangle, damping)
        left = residuals(tried)
        tried_square = float(np.sum(left**2))
        # Not a number counts as a failure.
        if tried_square < square:
            values, square = tried, tried_square
            damping = max(_SMALLER * damping, _SMALLEST_DAMPING)
            triangle = _triangle(slopes(values), left)
        else:
            damping *= _LARGER
    return values


def _triangle(slopes: Array, left: Array) -> Array:
    """R of the slopes' QR decomposition with Q'r as its last column.

    The normal equations would lose the flat directions, along which such fits go on for long.
    """
    triangle: Array = np.linalg.qr(np.column_stack([slopes, left]), mode="r")
    return triangle


def _step(triangle: Array, damping: float) -> Array:
    """Least-squares solution of the linearised problem with damping added."""
    count = triangle.shape[1] - 1
    damped = np.vstack([triangle[:, :-1], np.sqrt(damping) * np.eye(count)])
    wanted = np.concatenate([triangle[:, -1], np.zeros(count)])
    step: Array = np.linalg.lstsq(damped, wanted, rcond=None)[0]
    return step
