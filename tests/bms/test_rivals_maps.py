"""Static maps: the C code against numpy, and the fits that go into it."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.data.lags import Lag
from bms.data.simulate import Samples, joined
from bms.studies.rivals.effort import Effort
from bms.studies.rivals.estimator import BASE_COLUMNS, Sequences
from bms.studies.rivals.floor import static_floor
from bms.studies.rivals.linear import LinearEstimator, QuadraticEstimator
from bms.studies.rivals.perceptron import Perceptron, PerceptronEstimator, hidden_nodes
from bms.studies.rivals.timing import REPEATS, time_per_estimate_ns
from tests.bms.rival_samples import charge

FLOAT32_K = 1e-3
SHORT = Effort(1, (30, 70), (40,), 30)


@pytest.fixture(scope="module")
def samples():
    charges = joined(charge(seed=seed, start_K=280.0 + 7.0 * seed) for seed in range(5))
    # A fifth column that a linear map may use, as a lagged input.
    extra = np.cos(np.arange(len(charges.inputs)))[:, None]
    core_K = charges.core_temperature_K + 0.5 * extra[:, 0]
    return dataclasses.replace(
        charges, inputs=np.hstack([charges.inputs, extra]), core_temperature_K=core_K
    )


def estimate(estimator, samples):
    data = Sequences.of(samples)
    return estimator.estimate(data.of_columns(estimator.columns), data.starts)


@pytest.mark.parametrize("columns", [BASE_COLUMNS, range(5)])
def test_linear_map_is_the_least_squares_solution(samples, columns):
    estimator = LinearEstimator("linear", samples, columns, ())

    terms = np.hstack([samples.inputs[:, list(columns)], np.ones((len(samples.inputs), 1))])
    solution = np.linalg.lstsq(terms, samples.core_temperature_K, rcond=None)[0]
    assert np.abs(estimate(estimator, samples) - terms @ solution).max() < FLOAT32_K
    assert estimator.cost.parameters == len(solution)
    assert estimator.cost.bytes == 4 * (2 * len(columns) + 1)
    assert estimator.cost.multiply_adds == len(columns)


def test_lagged_linear_map_pays_for_its_filters(samples):
    plain = LinearEstimator("linear", samples, range(5), ()).cost

    lagged = LinearEstimator("linear", samples, range(5), (Lag("current_squared_A2", 9.0),)).cost

    # A decay, a gain, the filter's value and the last surface temperature; two products, a square.
    assert lagged.bytes == plain.bytes + 4 * 4
    assert lagged.multiply_adds == plain.multiply_adds + 3


def test_linear_map_of_a_channel_that_does_not_vary_stays_small(samples):
    still = samples.inputs.copy()
    still[:, 1] = 0.0
    still = dataclasses.replace(samples, inputs=still)
    moved = still.inputs.copy()
    moved[:, 1] = 1.0

    estimator = LinearEstimator("linear", still, BASE_COLUMNS, ())

    changed_K = estimate(estimator, dataclasses.replace(still, inputs=moved))
    assert np.abs(changed_K - estimate(estimator, still)).max() < FLOAT32_K


def test_quadratic_map_finds_a_quadratic_truth_and_pays_for_every_product(samples):
    centered = samples.inputs[:, :4] - samples.inputs[:, :4].mean(axis=0)
    slope_K = np.array([0.05, -0.8, 0.9, 0.1])
    curve_K = np.array([[4e-3, 0.02, 0, 1e-3], [0, 0.3, 0.01, 0], [0, 0, 2e-3, 0], [0, 0, 0, 1e-3]])
    core_K = 300.0 + centered @ slope_K + np.einsum("ni,ij,nj->n", centered, curve_K, centered)
    truth = dataclasses.replace(samples, core_temperature_K=core_K)

    estimator = QuadraticEstimator("quadratic", truth, BASE_COLUMNS, ())

    assert np.abs(estimate(estimator, truth) - core_K).max() < FLOAT32_K
    linear = LinearEstimator("linear", truth, BASE_COLUMNS, ())
    assert np.abs(estimate(linear, truth) - core_K).max() > 10 * FLOAT32_K
    assert estimator.cost.parameters == 1 + 4 + 10
    assert estimator.cost.bytes == 4 * (4 + 4 + 10 + 1)
    assert estimator.cost.multiply_adds == 4 + 10


def test_quadratic_map_of_a_channel_that_does_not_vary_is_that_of_the_others(samples):
    still = samples.inputs.copy()
    still[:, 1] = 0.2
    still = dataclasses.replace(samples, inputs=still)

    estimator = QuadraticEstimator("quadratic", still, BASE_COLUMNS, ())
    others = QuadraticEstimator("quadratic", still, (0, 2, 3), ())

    assert np.abs(estimate(estimator, still) - estimate(others, still)).max() < FLOAT32_K


def test_perceptron_in_c_sums_and_squashes_as_scikit_learn_does(samples):
    network = pytest.importorskip("sklearn.neural_network")
    estimator = PerceptronEstimator(samples, samples, 3, SHORT, seed=1)
    weights, scaling = estimator.perceptron, estimator.scaling
    regressor = network.MLPRegressor(hidden_layer_sizes=(3,), activation="tanh", max_iter=1)
    scaled = (samples.inputs[:, :4] - scaling.center) / scaling.half_range
    with pytest.warns(UserWarning):
        regressor.fit(scaled, samples.core_temperature_K)
    regressor.coefs_ = [weights.hidden.T, weights.output[:, None]]
    regressor.intercepts_ = [weights.bias, np.array([weights.offset])]

    expected_K = scaling.output_center_K + scaling.output_half_range_K * regressor.predict(scaled)

    assert np.abs(estimate(estimator, samples) - expected_K).max() < FLOAT32_K


def test_perceptron_is_fitted_and_the_same_for_the_same_seed(samples):
    one, other = (PerceptronEstimator(samples, samples, 3, SHORT, seed=1) for _ in range(2))
    plain = LinearEstimator("linear", samples, BASE_COLUMNS, ())

    def rmse_K(estimator):
        return np.sqrt(np.mean((estimate(estimator, samples) - samples.core_temperature_K) ** 2))

    assert np.array_equal(estimate(one, samples), estimate(other, samples))
    assert rmse_K(one) < rmse_K(plain)


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_slopes_of_the_perceptron_are_its_derivatives(nodes, seed):
    rng = np.random.default_rng(seed)
    weights, x = rng.standard_normal(6 * nodes + 1), rng.uniform(-1.0, 1.0, (5, 4))
    differences = [
        (Perceptron.of(weights + h, nodes).values(x) - Perceptron.of(weights - h, nodes).values(x))
        / 2e-5
        for h in 1e-5 * np.eye(len(weights))
    ]

    slopes = Perceptron.of(weights, nodes).slopes(x)

    assert slopes == pytest.approx(np.stack(differences, axis=1), abs=1e-7)


@given(st.integers(1, 500))
def test_perceptron_has_no_fewer_parameters_than_asked_and_hardly_more(parameters):
    own = 6 * hidden_nodes(parameters) + 1

    assert parameters <= own < parameters + 6 or own == 7


def test_floor_is_no_worse_than_any_of_its_candidates(samples):
    problem = FloorProblem(samples)
    perceptron = PerceptronEstimator(samples, samples, 3, SHORT, seed=0)
    truth_K = samples.core_temperature_K

    floor = static_floor(perceptron, problem, SHORT, seed=0)

    error_K = np.sqrt(np.mean((estimate(floor, samples) - truth_K) ** 2))
    for rival in (perceptron, LinearEstimator("linear", samples, BASE_COLUMNS, ())):
        assert error_K <= np.sqrt(np.mean((estimate(rival, samples) - truth_K) ** 2)) + FLOAT32_K
    assert floor.cost is None
    assert floor.given.endswith("the samples themselves")


@dataclasses.dataclass(frozen=True)
class FloorProblem:
    """The part of a problem that the floor asks for."""

    training: Samples
    floor_chosen_by: str = "the samples themselves"

    @property
    def floor_choice(self):
        return self.training


def test_time_is_the_median_of_the_runs_by_the_clock_that_is_passed(samples):
    data = Sequences.of(samples)
    durations = iter([10**9] * 3 + [len(samples.inputs) * 25] * (REPEATS - 3))
    now, running = 0, False

    def clock_ns():
        nonlocal now, running
        if running:
            now += next(durations)
        running = not running
        return now

    linear = LinearEstimator("linear", samples, BASE_COLUMNS, ())

    assert time_per_estimate_ns(linear, data, clock_ns) == 25.0
