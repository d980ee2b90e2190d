"""All estimators on one problem: errors, costs and times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from bms.arrays import Array
from bms.data.lags import Lags
from bms.kan.accuracy import ErrorFigures, error_figures
from bms.model.model_file import KanModel
from bms.studies.rivals.effort import FULL, Effort
from bms.studies.rivals.estimator import BASE_COLUMNS, Cost, Estimator, Sequences
from bms.studies.rivals.filters import ExtendedKalman, FullKalman, SteadyKalman
from bms.studies.rivals.floor import FLOOR, static_floor
from bms.studies.rivals.kan import KanEstimator, trained_parameters
from bms.studies.rivals.lagged import columns_of
from bms.studies.rivals.linear import LinearEstimator, QuadraticEstimator
from bms.studies.rivals.perceptron import PerceptronEstimator, hidden_nodes
from bms.studies.rivals.problem import Problem
from bms.studies.rivals.timing import Clock, time_per_estimate_ns

Role = Literal["kan", "filter", "perceptron", "polynomial", "floor"]

KINDS = 4
"""Of estimators besides the models: filters, perceptron, linear maps, floor."""
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

    `errors` is empty, and `remark` says why, when it was not run; `counted` is the scope that
    figures are compared on. The floor has neither cost nor time: it is no estimator in C.
    `read_rmse_K` is over the same samples as the sensors show them.
    """

    name: str
    role: Role
    is_static: bool
    given: str
    errors: dict[str, ErrorFigures]
    counted: str
    read_rmse_K: float | None
    cost: Cost | None
    time_per_estimate_ns: float | None
    remark: str = ""

    @property
    def rmse_K(self) -> float:
        """RMSE over the samples that count."""
        return self.errors[self.counted].rmse_K


@dataclass(frozen=True)
class Trace:
    """Error of every estimator over one profile in K, at times in s."""

    title: str
    time_s: Array
    error_K: dict[str, Array]


@dataclass(frozen=True)
class Comparison:
    """Rows of the table in their order, and a trace of one profile."""

    title: str
    rows: tuple[Row, ...]
    trace: Trace


def run_comparison(
    problem: Problem,
    models: Sequence[NamedModel],
    seed: int,
    clock_ns: Clock,
    effort: Effort = FULL,
    note: Callable[[str], None] = lambda estimators: None,
) -> Comparison:
    """Every estimator fitted to the problem's data and run on its test, in float32 C.

    `seed` is that of the fits; all but the times is deterministic. `note` is told which estimators
    come next: each model, and KINDS besides.
    """
    begin, end = problem.test.starts[problem.trace_profile : problem.trace_profile + 2]
    rows: list[Row] = []
    trace_error_K: dict[str, Array] = {}

    def add(role: Role, estimator: Estimator) -> None:
        estimate_K = _run(estimator, problem.test)
        error_K = estimate_K - problem.test.core_temperature_K
        trace_error_K[estimator.name] = error_K[begin:end]
        rows.append(_row(problem, role, estimator, estimate_K, clock_ns))

    told = (problem.cell, problem.noise, problem.period_s)
    for name, model in models:
        note(name)
        add("kan", KanEstimator(name, model, columns_of(model.network, problem.lags)))
    note("Kalman filters")
    add("filter", SteadyKalman(*told, problem.cell_origin))
    add("filter", FullKalman(*told, problem.cell_origin))
    ignorant = f"{problem.cell_origin}, not R0"
    add("filter", ExtendedKalman(*told, ignorant, problem.resistance_start))
    if problem.tuned is not None:
        name = "Kalman (steady gain, tuned)"
        given = "a cell and noise tuned to the core temperature of the training data"
        add("filter", SteadyKalman(*problem.tuned, problem.period_s, given, name))
    note("perceptron")
    static = [model.network for _, model in models if not model.network.lags]
    nodes = hidden_nodes(trained_parameters(static[0]) if static else PAPER_PARAMETERS)
    perceptron = PerceptronEstimator(
        problem.before_validation, problem.validation, nodes, effort, seed
    )
    add("perceptron", perceptron)
    note("least squares")
    every = range(problem.training.inputs.shape[1])
    taken: dict[str, tuple[Sequence[int], Lags]] = {"": (BASE_COLUMNS, ())}
    if problem.lags:
        taken[" (lagged inputs)"] = (every, problem.lags)
    for what, (columns, lags) in taken.items():
        linear = LinearEstimator(f"least squares{what}", problem.training, columns, lags)
        add("polynomial", linear)
        quadratic = QuadraticEstimator(
            f"quadratic least squares{what}", problem.training, columns, lags
        )
        add("polynomial", quadratic)
    note("floor of static maps")
    try:
        add("floor", static_floor(perceptron, problem, effort, seed))
    except ModuleNotFoundError:
        rows.append(_floor_not_run(problem, NO_SCIKIT_LEARN))
    trace = Trace(problem.trace_title, problem.test.time_s[begin:end], trace_error_K)
    return Comparison(problem.title, tuple(rows), trace)


def _row(
    problem: Problem, role: Role, estimator: Estimator, estimate_K: Array, clock_ns: Clock
) -> Row:
    test, read, counted = problem.test, problem.read, problem.scopes[problem.counted]
    return Row(
        name=estimator.name,
        role=role,
        is_static=role != "filter" and estimator.columns == BASE_COLUMNS,
        given=estimator.given,
        errors={
            scope: error_figures(estimate_K[mask], test.core_temperature_K[mask])
            for scope, mask in problem.scopes.items()
        },
        counted=problem.counted,
        read_rmse_K=None
        if read is None
        else error_figures(_run(estimator, read)[counted], read.core_temperature_K[counted]).rmse_K,
        cost=estimator.cost,
        time_per_estimate_ns=None
        if estimator.cost is None
        else time_per_estimate_ns(estimator, test, clock_ns),
    )


def _floor_not_run(problem: Problem, reason: str) -> Row:
    return Row(FLOOR, "floor", True, "", {}, problem.counted, None, None, None, reason)


def _run(estimator: Estimator, data: Sequences) -> Array:
    return estimator.estimate(data.of_columns(estimator.columns), data.starts)
