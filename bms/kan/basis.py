"""B-spline basis on extended, possibly non-uniform knots, and the silu base function."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array


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
    return _orders(x, knots, degree)[-1]


def basis_with_slope(x: Array, knots: Array, degree: int) -> tuple[Array, Array]:
    """B-splines and their derivatives at x (N,), each of shape (G + degree, N)."""
    lower, values = _orders(x, knots, degree)[-2:]
    scaled = lower * (degree / (knots[degree:] - knots[:-degree]))[:, None]
    return values, scaled[:-1] - scaled[1:]


def _orders(x: Array, knots: Array, degree: int) -> list[Array]:
    """B-splines of degree 0 to `degree`."""
    distances = x - knots[:, None]
    values = ((distances[:-1] >= 0.0) & (distances[1:] < 0.0)).astype(np.float64)
    orders = [values]
    for order in range(1, degree + 1):
        ratios = values / (knots[order:] - knots[:-order])[:, None]
        values = distances[: -order - 1] * ratios[:-1] - distances[order + 1 :] * ratios[1:]
        orders.append(values)
    return orders
