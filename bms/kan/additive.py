"""Networks of one hidden node fitted in closed form: a smooth sum of functions, then one of it.

A network [n, 1, 1] is an outer function of a sum of functions of the single inputs. With the
outer one left out, the sum is linear in its B-spline coefficients, and so is the outer function of
a given sum: two penalised least-squares problems (P-splines on an additive model; Eilers and Marx
1996, Hastie and Tibshirani 1986). The penalty on the curvature makes the functions straight where
data are few, so that a short recording is not fitted with bends that the next one lacks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from bms.arrays import Array
from bms.kan.basis import basis, extended_knots
from bms.kan.grid import blended_grid, hidden_span
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import TrainableLayer, activations, expand, forward

_MARGIN = 0.05
_PROBES = 256


@dataclass(frozen=True)
class _Spline:
    """Knots of a function, its B-splines at the samples (C, N) and its curvature's matrix (Q, C).

    The squared norm of curvature @ coefficients is the integral of the squared second derivative,
    for an argument that is scaled to -1..1.
    """

    knots: Array
    design: Array
    curvature: Array


def additive_layers(
    x: Array, target: Array, settings: TrainingSettings, reach: float, roughness: float
) -> list[TrainableLayer]:
    """Layers of a network [n, 1, 1] for normalised inputs x (n, N) and target (N,).

    The inputs' functions span -reach..reach, and the outer one what they can add up to there;
    `roughness` weighs their squared curvature against the mean squared error.
    """
    span = (-reach, reach)
    inner = [_spline(np.clip(row, *span), span, settings) for row in x]
    first = _layer(inner, _penalised_fit(inner, target, roughness), settings)
    hidden = forward([first], x)[0]
    low, high = hidden_span(hidden, _MARGIN)
    if reach > 1.0:
        everywhere = np.tile(np.linspace(*span, _PROBES), (len(x), 1))
        values = activations(first, expand(first, everywhere))
        low = min(low, float(values.min(axis=2).sum()))
        high = max(high, float(values.max(axis=2).sum()))
    outer = [_spline(hidden, (low, high), settings)]
    return [first, _layer(outer, _penalised_fit(outer, target, roughness), settings)]


def _spline(column: Array, span: tuple[float, float], settings: TrainingSettings) -> _Spline:
    degree = settings.degree
    grid = blended_grid(column, settings.grid, span)
    knots = extended_knots(grid, degree)
    return _Spline(knots, basis(column, knots, degree), _curvature(grid, knots, degree))


def _curvature(grid: Array, knots: Array, degree: int) -> Array:
    identity = np.eye(len(grid) - 1 + degree)
    half_width = 0.5 * (grid[-1] - grid[0])
    if degree == 1:
        # All the bend is at the grid points, as jumps of the slope.
        slopes = np.diff(identity, axis=0) / np.diff(grid)[:, None]
        return np.asarray(half_width * np.diff(slopes, axis=0))
    nodes, weights = np.polynomial.legendre.leggauss(degree)
    middles, halves = 0.5 * (grid[1:] + grid[:-1]), 0.5 * np.diff(grid)
    points = (middles[:, None] + halves[:, None] * nodes).ravel()
    second = BSpline(knots, identity, degree).derivative(2)(points)
    scale = np.sqrt((halves[:, None] * weights).ravel() / half_width) * half_width**2
    return np.asarray(scale[:, None] * second)


def _penalised_fit(splines: list[_Spline], target: Array, roughness: float) -> Array:
    """Coefficients of all functions in one row: least squares of least norm."""
    design = np.concatenate([spline.design for spline in splines])
    gram = design @ design.T / target.size
    sizes = np.cumsum([0, *(len(spline.design) for spline in splines)])
    for begin, end, spline in zip(sizes, sizes[1:], splines):
        gram[begin:end, begin:end] += roughness * spline.curvature.T @ spline.curvature
    fit: Array = np.linalg.lstsq(gram, design @ target / target.size, rcond=None)[0]
    return fit


def _layer(splines: list[_Spline], row: Array, settings: TrainingSettings) -> TrainableLayer:
    inputs = len(splines)
    return TrainableLayer(
        settings.degree,
        np.stack([spline.knots for spline in splines]),
        np.zeros((1, inputs)),
        np.ones((1, inputs)),
        row.reshape(1, inputs, -1),
    )
