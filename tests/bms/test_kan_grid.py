"""Grids follow the data without changing what the network computes."""

import numpy as np
import pytest

from bms.kan.basis import uniform_knots
from bms.kan.grid import follow_data, solve_last_layer
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import TrainableLayer, forward
from bms.kan.training import initial_layers


def layers_and_samples(width=(4, 2, 1), grid=4):
    rng = np.random.default_rng(2)
    layers = initial_layers(TrainingSettings(width=width, grid=grid), rng)
    return layers, rng.triangular(-1.0, 0.8, 1.0, (4, 2000)), rng


def test_first_grid_spans_the_box_and_hidden_grids_the_data_with_a_margin():
    layers, x, _ = layers_and_samples()

    first, second = follow_data(layers, x)

    degree = first.degree
    np.testing.assert_array_equal(first.knots[:, degree], -1.0)
    np.testing.assert_array_equal(first.knots[:, -degree - 1], 1.0)
    hidden = forward([first], x)
    margin = 0.05 * np.ptp(hidden, axis=1)
    np.testing.assert_allclose(second.knots[:, degree], hidden.min(axis=1) - margin)
    np.testing.assert_allclose(second.knots[:, -degree - 1], hidden.max(axis=1) + margin)


def test_inner_knots_lie_where_the_samples_are():
    layers, x, _ = layers_and_samples()

    first = follow_data(layers, x)[0]

    inner = first.knots[:, first.degree + 1 : -first.degree - 1]
    quartiles = np.quantile(x, [0.25, 0.5, 0.75], axis=1).T
    np.testing.assert_allclose(inner, 0.98 * quartiles + 0.02 * np.array([-0.5, 0.0, 0.5]))


def test_a_cubic_polynomial_survives_any_change_of_grid():
    # Cubic splines contain the cubic polynomials, whatever their knots.
    x = np.random.default_rng(0).uniform(-1.0, 1.0, (1, 500)) ** 3
    cubic = np.polynomial.Polynomial([0.3, -1.0, 0.5, 2.0])
    knots = uniform_knots(-1.0, 1.0, 5, 3)
    # Blossom of the polynomial at three knots in a row: the spline's coefficients.
    coefficients = [
        sum(
            weight * polar
            for weight, polar in zip(
                cubic.coef,
                (1.0, (a + b + c) / 3.0, (a * b + b * c + c * a) / 3.0, a * b * c),
            )
        )
        for a, b, c in zip(knots[1:], knots[2:], knots[3:-1])
    ]
    layer = TrainableLayer(
        3, knots[None], np.zeros((1, 1)), np.ones((1, 1)), np.array(coefficients)[None, None]
    )
    np.testing.assert_allclose(forward([layer], x), cubic(x), atol=1e-12)

    np.testing.assert_allclose(forward(follow_data([layer], x), x), cubic(x), atol=1e-10)


def test_node_that_never_varies_keeps_a_usable_grid():
    layers, x, _ = layers_and_samples((4, 1, 1), 2)
    x[:] = 0.3

    updated = follow_data(layers, x)

    assert np.all(np.diff(updated[1].knots) > 0.0)
    np.testing.assert_allclose(forward(updated, x), forward(layers, x), atol=1e-9)


@pytest.mark.parametrize("width", [(4, 1), (4, 1, 1), (4, 3, 1)])
def test_last_layer_is_a_least_squares_fit(width):
    layers, x, rng = layers_and_samples(width)
    target = rng.normal(size=x.shape[1])
    layers = follow_data(layers, x)

    solved = solve_last_layer(layers, x, target)

    residual = forward(solved, x)[0] - target
    best = float(residual @ residual)
    last = solved[-1]
    assert best < float(np.sum((forward(layers, x)[0] - target) ** 2))
    for _ in range(20):
        nudged = TrainableLayer(
            last.degree,
            last.knots,
            last.base_weights + 1e-3 * rng.normal(size=last.base_weights.shape),
            last.spline_weights,
            last.coefficients + 1e-3 * rng.normal(size=last.coefficients.shape),
        )
        worse = forward([*solved[:-1], nudged], x)[0] - target
        assert float(worse @ worse) > best
