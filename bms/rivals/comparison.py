"""All estimators on one problem: errors, costs and times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

from bms.kan.accuracy import error_figures
from bms.kan.basis import Array
from bms.kan.model_file import ErrorFigures, KanModel
from bms.rivals.estimator import BASE_COLUMNS, Cost, Estimator, Sequences
from bms.rivals.filters import ExtendedKalman, FullKalman, SteadyKalman
from bms.rivals.floor import static_floor
from bms.rivals.kan import KanEstimator, trained_parameters
from bms.rivals.lagged import columns_of
from bms.rivals.linear import LinearEstimator
from bms.rivals.perceptron import PerceptronEstimator, hidden_nodes
from bms.rivals.problem import ALL, Problem
from bms.rivals.timing import Clock, time_per_estimate_ns

Role = Literal["kan", "filter", "perceptron", "linear", "floor"]

PAPER_PARAMETERS = 35
"""Of the paper's network, [4,1,1] with G = 2 and k = 3."""
NO_SCIKIT_LEARN = (
    "not run: scikit-learn is not installed; install it with pip install 'kan-rcbf-bms[rivals]'"
)


class NamedModel(NamedTuple):
    """A network under the name that it has in the table."""

    name: str
    model: KanModel


@dataclass(frozen=True)
class Row:
    """One estimator: what it was given, errors by scope, cost and time per estimate.

    `errors` is empty, and `remark` says why, when it was not run. The floor has neither cost nor
    time: it is no estimator in C. `read_rmse_K` is over all samples as the sensors show them.
    """

    name: str
    role: Role
    is_static: bool
    given: str
    errors: dict[str, ErrorFigures]
    read_rmse_K: float | None
    cost: Cost | None
    time_per_estimate_ns: float | None
    remark: str = ""

    @property
    def rmse_K(self) -> float:
        """RMSE over all samples."""
        return self.errors[ALL].rmse_K


@dataclass(frozen=True)
class Trace:
    """Error of every estimator over one profile in K, at times in s."""

    time_s: Array
    error_K: dict[str, Array]


@dataclass(frozen=True)
class Comparison:
    """Rows of the table in their order, and a trace of one profile."""

    title: str
    rows: tuple[Row, ...]
    trace: Trace


def compare(
    problem: Problem, models: Sequence[NamedModel], seed: int, clock_ns: Clock
) -> Comparison:
    """Every estimator fitted to the problem's data and run on its test, in float32 C.

    `seed` is that of the fits; all but the times is deterministic.
    """
    test, read = problem.test, problem.read
    begin, end = test.starts[problem.trace_profile : problem.trace_profile + 2]
    rows: list[Row] = []
    trace_error_K: dict[str, Array] = {}
    for role, name, make in _estimators(problem, models, seed):
        try:
            estimator = make()
        except ImportError:
            rows.append(Row(name, role, True, "", {}, None, None, None, NO_SCIKIT_LEARN))
            continue
        estimate_K = _run(estimator, test)
        trace_error_K[estimator.name] = (estimate_K - test.core_temperature_K)[begin:end]
        rows.append(
            Row(
                estimator.name,
                role,
                role != "filter" and estimator.columns == BASE_COLUMNS,
                estimator.given,
                {
                    scope: error_figures(estimate_K[mask], test.core_temperature_K[mask])
                    for scope, mask in problem.scopes.items()
                },
                None
                if read is None
                else error_figures(_run(estimator, read), read.core_temperature_K).rmse_K,
                estimator.cost,
                None if estimator.cost is None else time_per_estimate_ns(estimator, test, clock_ns),
            )
        )
    return Comparison(problem.title, tuple(rows), Trace(test.time_s[begin:end], trace_error_K))


def _run(estimator: Estimator, data: Sequences) -> Array:
    return estimator.estimate(data.of_columns(estimator.columns), data.starts)


def _estimators(
    problem: Problem, models: Sequence[NamedModel], seed: int
) -> Iterator[tuple[Role, str, Callable[[], Estimator]]]:
    """Role, name to show when it cannot be made, and what makes it (ImportError if it cannot)."""
    training, validation = problem.training, problem.validation
    told = (problem.cell, problem.noise, problem.period_s)
    for name, model in models:
        columns = columns_of(model.network, problem.lags)
        yield "kan", name, partial(KanEstimator, name, model, columns)
    yield "filter", SteadyKalman.name, lambda: SteadyKalman(*told, problem.cell_origin)
    yield "filter", FullKalman.name, lambda: FullKalman(*told, problem.cell_origin)
    yield (
        "filter",
        "extended Kalman filter",
        lambda: ExtendedKalman(*told, f"{problem.cell_origin}, not R0", problem.resistance_start),
    )
    static = [model.network for _, model in models if not model.network.lags]
    nodes = hidden_nodes(trained_parameters(static[0]) if static else PAPER_PARAMETERS)
    yield "perceptron", "MLP", lambda: PerceptronEstimator(training, validation, nodes, seed)
    yield "linear", "", lambda: LinearEstimator("linear least squares", training, BASE_COLUMNS)
    if problem.lags:
        every = range(training.inputs.shape[1])
        yield (
            "linear",
            "",
            lambda: LinearEstimator("linear least squares, lagged inputs", training, every),
        )
    yield "floor", "floor of static maps", lambda: static_floor(training, validation, seed)
