"""B-spline basis on extended, possibly non-uniform knots, and the silu base function."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bms.arrays import Array

_AT_A_TIME = 4096


def silu(x: Array) -> Array:
    """x/(1 + e^-x), of any shape."""
    return x * _sigmoid(x)


def silu_slope(x: Array) -> Array:
    """Derivative of silu, of any shape."""
    sigmoid = _sigmoid(x)
    return sigmoid * (1.0 + x * (1.0 - sigmoid))


def _sigmoid(x: Array) -> Array:
    # The hyperbolic tangent does not overflow for large negative arguments, as e^-x would.
    return 0.5 * (1.0 + np.tanh(0.5 * x))


def uniform_knots(low: float, high: float, intervals: int, degree: int) -> Array:
    """Extended knots of a uniform grid from low to high, shape (intervals + 1 + 2 degree,)."""
    return extended_knots(np.linspace(low, high, intervals + 1), degree)


def extended_knots(grid: Array, degree: int) -> Array:
    """Grid points with `degree` more on each side, spaced by the mean interval."""
    spacing = (grid[-1] - grid[0]) / (len(grid) - 1)
    outside = spacing * np.arange(1, degree + 1)
    return np.concatenate([grid[0] - outside[::-1], grid, grid[-1] + outside])


def basis(x: Array, knots: Array, degree: int) -> Array:
    """All B-splines at x, shape (G + degree, N), for x (N,) within the grid.

    Cox-de Boor recursion; at the last grid point the value is the limit from the left, because
    the knots go on.
    """
    values = np.empty((len(knots) - 1 - degree, x.size))
    for part in _parts(x.size):
        *_, values[:, part] = _orders(x[part], knots, degree)
    return values


def basis_slope(x: Array, knots: Array, degree: int) -> Array:
    """Derivatives of all B-splines at x (N,), shape (G + degree, N)."""
    scale = (degree / (knots[degree:] - knots[:-degree]))[:, None]
    slopes = np.empty((len(knots) - 1 - degree, x.size))
    for part in _parts(x.size):
        *_, lower = _orders(x[part], knots, degree - 1)
        scaled = lower * scale
        np.subtract(scaled[:-1], scaled[1:], out=slopes[:, part])
    return slopes


def _parts(size: int) -> Iterator[slice]:
    """As many arguments at a time as have room in a processor's cache with their rows."""
    for begin in range(0, size, _AT_A_TIME):
        yield slice(begin, begin + _AT_A_TIME)


def _orders(x: Array, knots: Array, degree: int) -> Iterator[Array]:
    """B-splines of degree 0 to `degree`."""
    distances = x - knots[:, None]
    values = ((distances[:-1] >= 0.0) & (distances[1:] < 0.0)).astype(np.float64)
    yield values
    for order in range(1, degree + 1):
        ratios = values / (knots[order:] - knots[:-order])[:, None]
        values = distances[: -order - 1] * ratios[:-1] - distances[order + 1 :] * ratios[1:]
        yield values
