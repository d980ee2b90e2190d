"""Least-squares fit of a network's parameters by the method of Levenberg and Marquardt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.kan.descent import jacobian
from bms.kan.grid import solve_last_layer
from bms.kan.loss import parameters, with_parameters
from bms.kan.trainable import TrainableLayer, forward

_MOST_STEPS = 20
_SMALLEST_GAIN = 1e-3
_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-13, 1e6
_DAMPING_FACTOR = 8.0

Layers = list[TrainableLayer]


@dataclass(frozen=True)
class Points:
    """Normalised inputs (in, N) and wanted outputs (N,)."""

    x: Array
    y: Array


def fitted(layers: Layers, points: Points) -> Layers:
    """Layers after damped Gauss-Newton steps, until a step gains less than a thousandth."""
    layers = solve_last_layer(layers, points.x, points.y)
    error = forward(layers, points.x)[0] - points.y
    damping = _DAMPING
    for _ in range(_MOST_STEPS):
        slopes = jacobian(layers, points.x)
        curvature, gradient = slopes @ slopes.T, slopes @ error
        unit = np.diag(np.diag(curvature) + _LEAST_DAMPING * np.trace(curvature))
        before = float(error @ error)
        while damping < _MOST_DAMPING:
            step = np.linalg.solve(curvature + damping * unit, gradient)
            tried = with_parameters(layers, parameters(layers) - step)
            tried_error = forward(tried, points.x)[0] - points.y
            if tried_error @ tried_error < before:
                break
            damping *= _DAMPING_FACTOR
        else:
            break
        layers, error = tried, tried_error
        damping = max(damping / _DAMPING_FACTOR, _LEAST_DAMPING)
        if error @ error > (1.0 - _SMALLEST_GAIN) * before:
            break
    return layers
