"""The floor: what a large static map of the four inputs reaches, whatever it would cost.

An estimator that looks at one sample only cannot be much better than that on the same data. The
candidates are a linear map alone, and what it leaves fitted by a perceptron of 2305 parameters
(after more and more iterations) or by boosted trees; the best on validation data counts. They run
in double precision, not in C.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.data.simulate import Samples
from bms.kan.basis import Array
from bms.rivals.estimator import BASE_COLUMNS, Rows, Starts
from bms.rivals.scaling import Scaling

HIDDEN_NODES = (32, 32, 32)
ITERATIONS = (50, 100, 150, 300, 600)
_ROWS = 2**15
_TREES, _LEAVES, _RATE = 600, 63, 0.1


@dataclass(frozen=True)
class StaticFloor:
    """The best candidate: a linear map of the scaled inputs and a regressor on what it leaves."""

    name: str
    scaling: Scaling
    linear: Array
    unit: float
    regressor: Any
    given = "training data"
    columns = BASE_COLUMNS
    cost = None

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K, as Estimator says."""
        return self.evaluate(inputs.astype(np.float64))

    def evaluate(self, inputs: Array) -> Array:
        """Core temperature in K (N,) for inputs (N, 4 or more)."""
        scaled = self.scaling.of_inputs(inputs)
        linear = _terms(scaled) @ self.linear
        return self.scaling.temperature_K(linear + self.unit * self.regressor.predict(scaled))


def static_floor(
    training: Samples,
    validation: Samples,
    seed: int,
    iterations: tuple[int, ...] = ITERATIONS,
) -> StaticFloor:
    """Best large static map on validation data; ImportError without scikit-learn.

    The perceptron is judged after each of the `iterations`, which add up.
    """
    scaling = Scaling.of(training)
    inputs, wanted = scaling.of_inputs(training.inputs), scaling.output(training)
    linear: Array = np.linalg.lstsq(_terms(inputs), wanted, rcond=None)[0]
    left = wanted - _terms(inputs) @ linear
    unit = float(left.std()) or 1.0
    candidates = [
        StaticFloor(f"floor of static maps: {description}", scaling, linear, unit, regressor)
        for description, regressor in _regressors(inputs, left / unit, seed, iterations)
    ]
    truth_K = validation.core_temperature_K
    return min(
        candidates,
        key=lambda one: float(np.mean((one.evaluate(validation.inputs) - truth_K) ** 2)),
    )


def _regressors(
    inputs: Array, wanted: Array, seed: int, iterations: tuple[int, ...]
) -> Iterator[tuple[str, Any]]:
    # An optional extra of the package.
    from sklearn.dummy import DummyRegressor  # noqa: PLC0415
    from sklearn.ensemble import HistGradientBoostingRegressor  # noqa: PLC0415
    from sklearn.neural_network import MLPRegressor  # noqa: PLC0415

    yield "linear map", DummyRegressor(strategy="constant", constant=0.0).fit(inputs, wanted)
    trees = HistGradientBoostingRegressor(
        learning_rate=_RATE,
        max_iter=_TREES,
        max_leaf_nodes=_LEAVES,
        early_stopping=False,
        random_state=seed,
    )
    yield f"{_TREES} boosted trees", trees.fit(inputs, wanted)
    perceptron = MLPRegressor(
        hidden_layer_sizes=HIDDEN_NODES,
        activation="tanh",
        solver="lbfgs",
        alpha=0.0,
        tol=0.0,
        warm_start=True,
        random_state=seed,
    )
    rows = np.random.default_rng(seed).permutation(len(inputs))[:_ROWS]
    for count in iterations:
        perceptron.set_params(max_iter=count, max_fun=10 * count)
        with warnings.catch_warnings():
            # The limit of iterations is meant: the validation error decides.
            warnings.simplefilter("ignore")
            perceptron.fit(inputs[rows], wanted[rows])
        weights = sum(part.size for part in (*perceptron.coefs_, *perceptron.intercepts_))
        yield f"perceptron of {weights} parameters", copy.deepcopy(perceptron)


def _terms(inputs: Array) -> Array:
    return np.hstack([np.ones((len(inputs), 1)), inputs])
