"""A multilayer perceptron with one hidden layer, run in C."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from bms.arrays import Array
from bms.data.simulate import Samples
from bms.studies.rivals._rivals import ffi, lib
from bms.studies.rivals.effort import Effort
from bms.studies.rivals.estimator import BASE_COLUMNS, FLOAT32_BYTES, Cost, Rows, Starts
from bms.studies.rivals.native_array import filled, float_array, pointer
from bms.studies.rivals.scaling import Scaling

_INPUTS = len(BASE_COLUMNS)
_ROWS = 2**13
_TOLERANCE = 1e-12
_PULL = 1e-6


def hidden_nodes(parameters: int) -> int:
    """Nodes of one hidden layer with four inputs that give at least so many parameters."""
    return max(1, -(-(parameters - 1) // (_INPUTS + 2)))


@dataclass(frozen=True)
class Perceptron:
    """y = output . tanh(hidden x + bias) + offset, for scaled inputs x (4,).

    Shapes: hidden (nodes, 4), bias and output (nodes,).
    """

    hidden: Array
    bias: Array
    output: Array
    offset: float

    @classmethod
    def of(cls, weights: Array, nodes: int) -> Perceptron:
        """From all weights in a row: those of each node with its bias first, then the output's."""
        first = weights[: nodes * (_INPUTS + 1)].reshape(nodes, _INPUTS + 1)
        last = weights[nodes * (_INPUTS + 1) :]
        return cls(first[:, 1:], first[:, 0], last[1:], float(last[0]))

    def values(self, x: Array) -> Array:
        """y (N,) for scaled inputs x (N, 4)."""
        y: Array = self._nodes(x) @ self.output + self.offset
        return y

    def slopes(self, x: Array) -> Array:
        """Derivatives (N, weights) of y over all weights, in the order of `of`."""
        nodes = self._nodes(x)
        inner = (1.0 - nodes**2) * self.output
        one = np.ones((len(x), 1))
        hidden = inner[:, :, None] * np.hstack([one, x])[:, None, :]
        return np.hstack([hidden.reshape(len(x), -1), one, nodes])

    def _nodes(self, x: Array) -> Array:
        nodes: Array = np.tanh(x @ self.hidden.T + self.bias)
        return nodes


class PerceptronEstimator:
    """The four inputs through one hidden layer of tanh nodes.

    Levenberg-Marquardt on random rows from several starts; of the weights on the way those that are
    best on validation data are kept.
    """

    given = "training data"
    columns = BASE_COLUMNS

    def __init__(
        self, training: Samples, validation: Samples, nodes: int, effort: Effort, seed: int
    ) -> None:
        self.name = f"MLP [{_INPUTS},{nodes},1]"
        self.scaling = Scaling.of(training)
        weights = _trained(self.scaling, training, validation, nodes, effort, seed)
        self.perceptron = Perceptron.of(weights, nodes)
        width = [_INPUTS, nodes, 1]
        self.cost = Cost(
            len(weights),
            FLOAT32_BYTES * (len(weights) + 2 * _INPUTS + 2),
            (_INPUTS + 1) * nodes + _INPUTS + 1,
        )
        self._tables = {
            "width": ffi.new("uint32_t[]", width),
            "center": float_array(self.scaling.center),
            "scale": float_array(1.0 / self.scaling.half_range),
            "weights": float_array(weights),
        }
        self._mlp = ffi.new(
            "mlp_t *",
            {
                "layers": len(width) - 1,
                **self._tables,
                "output_center_K": self.scaling.output_center_K,
                "output_half_range_K": self.scaling.output_half_range_K,
            },
        )

    def evaluate(self, inputs: Array) -> Array:
        """Core temperature in K (N,) in double precision, for inputs (N, 4 or more)."""
        return self.scaling.temperature_K(self.perceptron.values(self.scaling.of_inputs(inputs)))

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return filled(
            lambda core_K: lib.mlp_rows(self._mlp, pointer(inputs), len(inputs), core_K),
            len(inputs),
        )


def _trained(
    scaling: Scaling,
    training: Samples,
    validation: Samples,
    nodes: int,
    effort: Effort,
    seed: int,
) -> Array:
    """All weights in the order of Perceptron.of, which is that of the C code."""
    rng = np.random.default_rng(seed)
    rows = rng.permutation(len(training.inputs))[:_ROWS]
    x, wanted = scaling.of_inputs(training.inputs)[rows], scaling.output(training)[rows]
    known_x, known = scaling.of_inputs(validation.inputs), scaling.output(validation)
    count = nodes * (_INPUTS + 2) + 1
    # Where a channel does not vary its weights would be free, and MINPACK's answer not repeatable.
    pull = _PULL * np.eye(count)

    def descended(weights: Array, steps: int) -> Array:
        found: Array = least_squares(
            lambda w: np.append(Perceptron.of(w, nodes).values(x) - wanted, pull @ w),
            weights,
            lambda w: np.vstack([Perceptron.of(w, nodes).slopes(x), pull]),
            method="lm",
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            gtol=_TOLERANCE,
            max_nfev=steps,
        ).x
        return found

    def mean_square(weights: Array) -> float:
        return float(np.mean((Perceptron.of(weights, nodes).values(known_x) - known) ** 2))

    candidates = []
    for _ in range(effort.perceptron_starts):
        weights = 0.5 * rng.standard_normal(count)
        for steps in effort.perceptron_steps:
            weights = descended(weights, steps)
            candidates.append(weights)
    return min(candidates, key=mean_square)
