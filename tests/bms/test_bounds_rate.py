"""The theorem's rate is found where it holds, and nowhere else."""

import numpy as np
import pytest
from scipy.interpolate import make_lsq_spline

from bms.bounds.rate import fit_rate, local_exponents
from bms.bounds.theorem import theorem_bound
from bms.data.simulate import Samples
from bms.kan.settings import TrainingSettings
from bms.kan.training import train_network

GRIDS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)


def sine_distances(degree):
    """Largest distance of the least-squares spline of each grid to sin(3x) on -1..1."""
    x = np.linspace(-1.0, 1.0, 4001)
    distances = []
    for grid in GRIDS:
        inner = np.linspace(-1.0, 1.0, grid + 1)
        knots = np.concatenate([[-1.0] * degree, inner, [1.0] * degree])
        spline = make_lsq_spline(x, np.sin(3.0 * x), knots, degree)
        distances.append(float(np.abs(spline(x) - np.sin(3.0 * x)).max()))
    return distances


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_splines_approach_a_sine_with_order_degree_plus_one(degree):
    distances = sine_distances(degree)

    rate = fit_rate(GRIDS, distances, degree + 1)

    assert rate is not None
    assert rate.exponent == pytest.approx(degree + 1, abs=0.4)
    assert rate.last_grid == 32
    bounds = rate.constant_K * np.array(GRIDS, dtype=float) ** -(degree + 1.0)
    inside = (np.array(GRIDS) >= rate.first_grid) & (np.array(GRIDS) <= rate.last_grid)
    assert np.all(np.array(distances)[inside] <= bounds[inside] * (1 + 1e-12))


def test_rate_ends_where_a_floor_begins():
    distances = [3.0 * grid**-4.0 + 1e-4 for grid in GRIDS]

    rate = fit_rate(GRIDS, distances, 4)

    assert rate is not None
    assert (rate.first_grid, rate.last_grid) == (1, 12)
    assert rate.constant_K == pytest.approx(3.0 + 1e-4 * 12**4, rel=1e-9)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.9])
def test_slower_fall_is_no_rate(exponent):
    assert fit_rate(GRIDS, [grid**-exponent for grid in GRIDS], 4) is None


def test_one_steep_step_is_too_little_for_a_rate():
    assert fit_rate((1, 2, 4, 8), (1.0, 1 / 16, 1 / 16, 1 / 256), 4) is None
    assert fit_rate((1, 2, 4, 8), (1.0, 1 / 16, 1 / 256, 1 / 256), 4) is not None


def test_local_exponents_are_slopes_in_logarithms():
    assert local_exponents((1, 2, 8, 32), (64.0, 9.0, 1.0, 1.0)) == pytest.approx(
        [2.0, np.log(9.0) / np.log(16.0)]
    )


LOW, HIGH = np.array([-24.0, 0.0, 280.0, 280.0]), np.array([0.0, 2.0, 320.0, 310.0])


def smooth_data(noise_K, count=6000):
    """Data of a smooth function that a [4, 1, 1] network can represent, with noise."""
    rng = np.random.default_rng(3)
    x = rng.uniform(-1.0, 1.0, (count, 4))
    hidden = 0.3 * np.sin(2 * x[:, 0]) + 0.1 * x[:, 1] ** 2 + 0.4 * x[:, 2] + 0.1 * np.exp(x[:, 3])
    core_K = 300.0 + 20.0 * np.tanh(hidden) + noise_K * rng.standard_normal(count)
    inputs = 0.5 * (LOW + HIGH) + 0.5 * x * (HIGH - LOW)
    return Samples(inputs, core_K, np.zeros(count, dtype=np.int64), np.arange(count) * 1.0)


@pytest.mark.long("training")
def test_sweep_finds_the_order_of_cubic_splines_and_the_floor_of_noisy_data():
    data = smooth_data(0.05)
    settings = TrainingSettings(epochs=5, refinement_steps=40)
    network = train_network(data, data, tuple(zip(LOW.tolist(), HIGH.tolist())), settings)

    bound = theorem_bound(network, data, 0)

    assert bound.order == 4
    assert bound.rate is not None
    assert bound.rate.exponent == pytest.approx(4.0, abs=0.7)
    assert bound.grids == GRIDS
    assert bound.largest_K[-1] < 1e-2 * bound.largest_K[0]
    assert all(rms <= largest for rms, largest in zip(bound.rms_K, bound.largest_K))
    assert bound.floor_rms_K == pytest.approx(0.05, rel=0.05)
    assert bound.model_grid == 2
