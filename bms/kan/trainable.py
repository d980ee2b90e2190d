"""One layer of the network as arrays, with its forward and backward pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bms.arrays import Array, Mask
from bms.kan.basis import basis, basis_slope, silu, silu_slope
from bms.kan.network import Edge, Layer


@dataclass(frozen=True)
class TrainableLayer:
    """Weights of the edges (out, in), coefficients (out, in, G + degree), knots for each input.

    All edges that leave one node share its knots, (in, G + 1 + 2 degree).
    """

    degree: int
    knots: Array
    base_weights: Array
    spline_weights: Array
    coefficients: Array

    @property
    def size(self) -> int:
        """Number of trained parameters."""
        return 2 * self.base_weights.size + self.coefficients.size

    def parameters(self) -> Array:
        """All trained parameters in one row: base weights, spline weights, coefficients."""
        parts = (self.base_weights, self.spline_weights, self.coefficients)
        return np.concatenate([part.ravel() for part in parts])

    def with_parameters(self, row: Array) -> TrainableLayer:
        """The same layer with the parameters of a row as `parameters` gives it."""
        shape, edges = self.base_weights.shape, self.base_weights.size
        return TrainableLayer(
            self.degree,
            self.knots,
            row[:edges].reshape(shape),
            row[edges : 2 * edges].reshape(shape),
            row[2 * edges :].reshape(self.coefficients.shape),
        )

    def frozen(self) -> Layer:
        """The layer as edges."""
        return tuple(
            tuple(
                Edge(
                    tuple(self.knots[source].tolist()),
                    float(self.base_weights[target, source]),
                    float(self.spline_weights[target, source]),
                    tuple(self.coefficients[target, source].tolist()),
                )
                for source in range(len(self.knots))
            )
            for target in range(len(self.base_weights))
        )


@dataclass(frozen=True)
class Expansion:
    """Base function (in, N) and B-splines (in, G + degree, N) of a layer's inputs, with slopes.

    Where an input was clamped to its grid the slopes are 0. They are computed when they are asked
    for, which a first layer's seldom are.
    """

    base: Array
    splines: Array
    _layer: TrainableLayer
    _clamped: Array
    _is_inside: Mask

    @cached_property
    def base_slope(self) -> Array:
        """Derivative of the base function, (in, N)."""
        return silu_slope(self._clamped) * self._is_inside

    @cached_property
    def spline_slopes(self) -> Array:
        """Derivatives of the B-splines, (in, G + degree, N)."""
        degree, rows = self._layer.degree, zip(self._clamped, self._layer.knots)
        slopes = np.stack([basis_slope(row, knots, degree) for row, knots in rows])
        slopes *= self._is_inside[:, None]
        return slopes


def expand(layer: TrainableLayer, x: Array) -> Expansion:
    """Functions of the inputs x (in, N) that do not depend on the trained parameters."""
    low, high = layer.knots[:, [layer.degree]], layer.knots[:, [-layer.degree - 1]]
    clamped = np.clip(x, low, high)
    pairs = zip(clamped, layer.knots)
    values = np.stack([basis(row, knots, layer.degree) for row, knots in pairs])
    return Expansion(silu(clamped), values, layer, clamped, x == clamped)


def splines(layer: TrainableLayer, expansion: Expansion) -> Array:
    """Spline sum of every edge, (in, out, N)."""
    return layer.coefficients.swapaxes(0, 1) @ expansion.splines


def activations(layer: TrainableLayer, expansion: Expansion) -> Array:
    """phi of every edge, (in, out, N)."""
    base = layer.base_weights.T[:, :, None] * expansion.base[:, None]
    return base + layer.spline_weights.T[:, :, None] * splines(layer, expansion)


def activation_slopes(layer: TrainableLayer, expansion: Expansion) -> Array:
    """Derivative of phi of every edge by its input, (in, out, N)."""
    weighted = (layer.spline_weights[:, :, None] * layer.coefficients).swapaxes(0, 1)
    base_slopes = layer.base_weights.T[:, :, None] * expansion.base_slope[:, None]
    return weighted @ expansion.spline_slopes + base_slopes


def backward(
    layer: TrainableLayer, expansion: Expansion, slope: Array, to_input: bool
) -> tuple[Array, Array | None]:
    """Gradient of a loss by parameters (as one row) and, if asked, by inputs (in, N).

    `slope` is the gradient of the loss by every phi, (in, out, N); its first axis may be 1.
    """
    by_base = (slope @ expansion.base[:, :, None])[:, :, 0].T
    by_basis = (slope @ expansion.splines.swapaxes(1, 2)).swapaxes(0, 1)
    by_spline = (by_basis * layer.coefficients).sum(axis=2)
    by_coefficient = layer.spline_weights[:, :, None] * by_basis
    row = np.concatenate([by_base.ravel(), by_spline.ravel(), by_coefficient.ravel()])
    if not to_input:
        return row, None
    return row, (slope * activation_slopes(layer, expansion)).sum(axis=1)


def forward(layers: list[TrainableLayer], x: Array) -> Array:
    """Values of the last layer's nodes (out, N) for the inputs x (in, N)."""
    for layer in layers:
        x = activations(layer, expand(layer, x)).sum(axis=0)
    return x
