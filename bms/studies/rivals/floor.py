"""The floor: what a large static map of the four inputs reaches, whatever it would cost.

An estimator that looks at one sample only cannot be much better than that on the same data. The
candidates are the perceptron of the table, a linear map, and a linear map with what it leaves
fitted by boosted trees or by a perceptron of 2305 parameters (after more and more iterations). They
run in double precision, not in C.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.studies.rivals.effort import Effort
from bms.studies.rivals.estimator import BASE_COLUMNS, Rows, Starts
from bms.studies.rivals.perceptron import PerceptronEstimator
from bms.studies.rivals.problem import Problem

FLOOR = "floor"
HIDDEN_NODES = (32, 32, 32)
_ROWS = 2**15
_LEAVES, _RATE = 63, 0.1


@dataclass(frozen=True)
class StaticFloor:
    """The best candidate; `evaluate` gives the core temperature in K for inputs (N, 4 or more)."""

    name: str
    evaluate: Callable[[Array], Array]
    given: str
    columns = BASE_COLUMNS
    cost = None

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return self.evaluate(inputs.astype(np.float64))


def static_floor(
    perceptron: PerceptronEstimator, problem: Problem, effort: Effort, seed: int
) -> StaticFloor:
    """The candidate that is best on `floor_choice`; ModuleNotFoundError without scikit-learn."""
    scaling, training, choice = perceptron.scaling, problem.training, problem.floor_choice
    given = f"training data, chosen by {problem.floor_chosen_by}"
    inputs, wanted = scaling.of_inputs(training.inputs), scaling.output(training)
    linear = np.linalg.lstsq(_terms(inputs), wanted, rcond=None)[0]
    left = wanted - _terms(inputs) @ linear
    unit = float(left.std()) or 1.0

    def with_linear_map(regressor: Any) -> Callable[[Array], Array]:
        def evaluate(unscaled: Array) -> Array:
            scaled = scaling.of_inputs(unscaled)
            return scaling.temperature_K(_terms(scaled) @ linear + unit * regressor.predict(scaled))

        return evaluate

    candidates = [StaticFloor(f"{FLOOR}: {perceptron.name}", perceptron.evaluate, given)]
    candidates += [
        StaticFloor(f"{FLOOR}: {description}", with_linear_map(regressor), given)
        for description, regressor in _regressors(inputs, left / unit, effort, seed)
    ]
    truth_K = choice.core_temperature_K
    return min(
        candidates,
        key=lambda one: float(np.mean((one.evaluate(choice.inputs) - truth_K) ** 2)),
    )


def _regressors(
    inputs: Array, wanted: Array, effort: Effort, seed: int
) -> Iterator[tuple[str, Any]]:
    # An optional extra of the package.
    from sklearn.dummy import DummyRegressor  # noqa: PLC0415
    from sklearn.ensemble import HistGradientBoostingRegressor  # noqa: PLC0415
    from sklearn.neural_network import MLPRegressor  # noqa: PLC0415

    yield "linear map", DummyRegressor(strategy="constant", constant=0.0).fit(inputs, wanted)
    trees = HistGradientBoostingRegressor(
        learning_rate=_RATE,
        max_iter=effort.floor_trees,
        max_leaf_nodes=_LEAVES,
        early_stopping=False,
        random_state=seed,
    )
    yield f"{effort.floor_trees} boosted trees", trees.fit(inputs, wanted)
    large = MLPRegressor(
        hidden_layer_sizes=HIDDEN_NODES,
        activation="tanh",
        solver="lbfgs",
        alpha=0.0,
        tol=0.0,
        warm_start=True,
        random_state=seed,
    )
    rows = np.random.default_rng(seed).permutation(len(inputs))[:_ROWS]
    for count in effort.floor_iterations:
        large.set_params(max_iter=count, max_fun=10 * count)
        with warnings.catch_warnings():
            # The limit of iterations is meant: the validation error decides.
            warnings.simplefilter("ignore")
            large.fit(inputs[rows], wanted[rows])
        weights = sum(part.size for part in (*large.coefs_, *large.intercepts_))
        yield f"MLP, {weights} parameters", copy.deepcopy(large)


def _terms(inputs: Array) -> Array:
    return np.hstack([np.ones((len(inputs), 1)), inputs])
