"""Grids that follow the data, and the refit that keeps the functions on a new grid."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.kan.basis import basis, extended_knots, silu
from bms.kan.trainable import TrainableLayer, expand, forward, splines

_UNIFORM_SHARE = 0.02
_HIDDEN_MARGIN = 0.05


def follow_data(layers: list[TrainableLayer], x: Array) -> list[TrainableLayer]:
    """Layers on grids that suit the samples x (in, N), refitted to their former functions.

    A grid blends a uniform one with the quantiles of what reaches the node. The first layer spans
    -1..1; a hidden grid spans what the samples reach and a margin of 5 % of that on either side.
    """
    updated: list[TrainableLayer] = []
    nodes = x
    for number, layer in enumerate(layers):
        updated.append(_on_new_grid(layer, nodes, is_first=number == 0))
        nodes = forward([updated[-1]], nodes)
    return updated


def _on_new_grid(layer: TrainableLayer, x: Array, is_first: bool) -> TrainableLayer:
    intervals = layer.knots.shape[1] - 1 - 2 * layer.degree
    wanted = splines(layer, expand(layer, x))
    knots, coefficients = [], []
    for source, column in enumerate(x):
        span = (-1.0, 1.0) if is_first else hidden_span(column, _HIDDEN_MARGIN)
        grid = blended_grid(column, intervals, span)
        knots.append(extended_knots(grid, layer.degree))
        design = basis(np.clip(column, grid[0], grid[-1]), knots[-1], layer.degree)
        coefficients.append(np.linalg.lstsq(design.T, wanted[source].T, rcond=None)[0].T)
    return TrainableLayer(
        layer.degree,
        np.stack(knots),
        layer.base_weights,
        layer.spline_weights,
        np.stack(coefficients, axis=1),
    )


def hidden_span(column: Array, margin: float) -> tuple[float, float]:
    """Range of a node's values (N,) and a margin, as a share of the range, on either side."""
    # A node that is constant still needs a grid of some width.
    beyond = margin * max(float(np.ptp(column)), 1e-3)
    return float(column.min()) - beyond, float(column.max()) + beyond


def blended_grid(column: Array, intervals: int, span: tuple[float, float]) -> Array:
    """Grid over `span` (intervals + 1,) that blends a uniform one with the values' quantiles."""
    uniform = np.linspace(*span, intervals + 1)
    quantiles = np.quantile(column, np.linspace(0.0, 1.0, intervals + 1))
    quantiles[0], quantiles[-1] = span
    return _UNIFORM_SHARE * uniform + (1.0 - _UNIFORM_SHARE) * quantiles


def solve_last_layer(layers: list[TrainableLayer], x: Array, target: Array) -> list[TrainableLayer]:
    """Layers whose last one is the least-squares fit to the target (N,) on its present grid.

    The output is linear in the last layer; its spline weights become 1.
    """
    last = layers[-1]
    nodes = forward(layers[:-1], x)
    low, high = last.knots[:, [last.degree]], last.knots[:, [-last.degree - 1]]
    nodes = np.clip(nodes, low, high)
    design = [
        silu(nodes),
        *(basis(row, knots, last.degree) for row, knots in zip(nodes, last.knots)),
    ]
    fit = np.linalg.lstsq(np.concatenate(design).T, target, rcond=None)[0]
    solution = np.asarray(fit, dtype=np.float64)
    inputs = len(last.knots)
    solved = TrainableLayer(
        last.degree,
        last.knots,
        solution[None, :inputs],
        np.ones((1, inputs)),
        solution[inputs:].reshape(1, inputs, -1),
    )
    return [*layers[:-1], solved]
