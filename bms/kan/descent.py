"""L-BFGS on the network's parameters, and the change of variables that makes it fast."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from bms.arrays import Array
from bms.kan.loss import Loss, parameters, with_parameters
from bms.kan.trainable import TrainableLayer, activation_slopes, activations, expand, splines

_MEMORY = 20
_SMALLEST_CURVATURE = 1e-8


def descend(
    layers: list[TrainableLayer], loss: Loss, steps: int, directions: Array | None = None
) -> list[TrainableLayer]:
    """Layers after at most `steps` L-BFGS steps; with `directions`, in coordinates along them."""
    start = parameters(layers)
    to_parameters = np.eye(start.size) if directions is None else directions

    def in_coordinates(coordinates: Array) -> tuple[float, Array]:
        value, gradient = loss(start + to_parameters @ coordinates)
        return value, gradient @ to_parameters

    result = minimize(
        in_coordinates,
        np.zeros(start.size),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": steps, "maxcor": _MEMORY, "ftol": 0.0, "gtol": 0.0},
    )
    return with_parameters(layers, start + to_parameters @ np.asarray(result.x))


def gauss_newton_directions(layers: list[TrainableLayer], x: Array) -> Array:
    """Columns in which the squared error of the samples x (in, N) is curved alike, (P, P).

    Inverse square root of the Gauss-Newton matrix. B-spline coefficients are badly scaled against
    each other, and without this L-BFGS needs some thousand steps more.
    """
    slopes = jacobian(layers, x)
    curvature, vectors = np.linalg.eigh(slopes @ slopes.T / x.shape[1])
    floor = _SMALLEST_CURVATURE * curvature[-1]
    return np.asarray(vectors / np.sqrt(np.maximum(curvature, floor)))


def jacobian(layers: list[TrainableLayer], x: Array) -> Array:
    """Derivative of the output by every parameter, (P, N)."""
    expansions = []
    for layer in layers:
        expansions.append(expand(layer, x))
        x = activations(layer, expansions[-1]).sum(axis=0)
    rows: list[Array] = []
    by_nodes = np.ones_like(x)
    for layer, expansion in zip(layers[::-1], expansions[::-1]):
        by_base = by_nodes[:, None] * expansion.base
        by_spline = by_nodes[:, None] * splines(layer, expansion).swapaxes(0, 1)
        by_coefficient = (by_nodes * layer.spline_weights.T[:, :, None]).swapaxes(0, 1)[
            :, :, None
        ] * expansion.splines
        parts = (by_base, by_spline, by_coefficient)
        rows = [*(part.reshape(-1, x.shape[1]) for part in parts), *rows]
        by_nodes = (by_nodes * activation_slopes(layer, expansion)).sum(axis=1)
    return np.concatenate(rows)
