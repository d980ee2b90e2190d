"""Training loss with the paper's penalties, and its gradient by back-propagation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.kan.trainable import Expansion, TrainableLayer, activations, backward, expand

_TINY = 1e-300


@dataclass(frozen=True)
class Penalty:
    """Weights of the penalties: regularisation (l1 l1_weight + entropy entropy_weight)."""

    regularisation: float
    l1_weight: float
    entropy_weight: float


class Loss:
    """Mean squared error of the normalised output plus penalties, for one batch.

    l1 is the sum over a layer's edges of their mean |phi|; the entropy is that of the edges'
    shares in it; both are summed over layers. Source: Liu et al. 2024, KAN, section 2.5; weights
    from the paper's table.
    """

    def __init__(
        self, layers: list[TrainableLayer], x: Array, target: Array, penalty: Penalty
    ) -> None:
        """`x` (in, N) and `target` (N,) are normalised; knots stay as those of `layers`."""
        self._layers = layers
        self._target = target
        self._penalty = penalty
        self._first = expand(layers[0], x)

    def __call__(self, parameters: Array) -> tuple[float, Array]:
        """Loss and its gradient at the parameters of all layers in one row."""
        layers = with_parameters(self._layers, parameters)
        expansion = self._first
        caches: list[tuple[Expansion, Array]] = []
        for number, layer in enumerate(layers):
            if number > 0:
                expansion = expand(layer, caches[-1][1].sum(axis=0))
            caches.append((expansion, activations(layer, expansion)))
        error = caches[-1][1].sum(axis=0) - self._target
        loss = float(np.mean(error**2))
        by_nodes = (2.0 / error.size) * error
        rows = []
        for number in range(len(layers) - 1, -1, -1):
            expansion, phi = caches[number]
            cost, by_phi = self._cost(phi)
            loss += cost
            row, by_inputs = backward(layers[number], expansion, by_phi + by_nodes, number > 0)
            rows.append(row)
            if by_inputs is not None:
                by_nodes = by_inputs
        return loss, np.concatenate(rows[::-1])

    def _cost(self, phi: Array) -> tuple[float, Array]:
        """Penalty on one layer's activations and its gradient, which broadcasts to their shape."""
        if self._penalty.regularisation == 0.0:
            return 0.0, np.zeros((1, 1, 1))
        magnitude = np.abs(phi).mean(axis=2)
        total = float(magnitude.sum())
        share = np.maximum(magnitude / max(total, _TINY), _TINY)
        entropy = float(-(share * np.log(share)).sum())
        weights = self._penalty
        by_magnitude = weights.l1_weight - weights.entropy_weight * (np.log(share) + entropy) / max(
            total, _TINY
        )
        cost = weights.l1_weight * total + weights.entropy_weight * entropy
        by_phi = np.sign(phi) * by_magnitude[:, :, None] / phi.shape[2]
        return weights.regularisation * cost, weights.regularisation * by_phi


def with_parameters(layers: list[TrainableLayer], row: Array) -> list[TrainableLayer]:
    """The layers with new parameters, taken from one row."""
    ends = np.cumsum([layer.size for layer in layers])
    parts = np.split(row, ends[:-1])
    return [layer.with_parameters(part) for layer, part in zip(layers, parts)]


def parameters(layers: list[TrainableLayer]) -> Array:
    """Parameters of all layers in one row."""
    return np.concatenate([layer.parameters() for layer in layers])
