"""The loss is the paper's, and its gradient is that of finite differences."""

import numpy as np
import pytest

from bms.kan.descent import descend, gauss_newton_directions
from bms.kan.grid import follow_data
from bms.kan.loss import Loss, Penalty, parameters, with_parameters
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import activations, expand, forward
from bms.kan.training import initial_layers

NO_PENALTY = Penalty(0.0, 0.0, 0.0)
STRONG = Penalty(0.3, 0.14, 0.17)


def problem(width=(4, 3, 2, 1), grid=3, degree=3, samples=400, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, (4, samples))
    settings = TrainingSettings(width=width, grid=grid, degree=degree)
    layers = follow_data(initial_layers(settings, rng), x)
    return layers, x, rng.normal(size=samples)


@pytest.mark.parametrize("penalty", [NO_PENALTY, STRONG])
@pytest.mark.parametrize(
    ("width", "grid", "degree"), [((4, 1, 1), 2, 3), ((4, 1), 1, 2), ((4, 3, 2, 1), 3, 3)]
)
def test_gradient_of_all_parameters_is_that_of_finite_differences(width, grid, degree, penalty):
    layers, x, target = problem(width, grid, degree)
    loss = Loss(layers, x, target, penalty)
    start = parameters(layers)

    gradient = loss(start)[1]

    step = 1e-6
    difference = [
        (loss(start + step * unit)[0] - loss(start - step * unit)[0]) / (2.0 * step)
        for unit in np.eye(start.size)
    ]
    np.testing.assert_allclose(gradient, difference, rtol=1e-5, atol=1e-8)


def test_loss_is_mean_square_error_plus_l1_and_entropy_of_every_layer():
    layers, x, target = problem()

    value = Loss(layers, x, target, STRONG)(parameters(layers))[0]

    nodes, penalty = x, 0.0
    for layer in layers:
        phi = activations(layer, expand(layer, nodes))
        magnitudes = [np.mean(np.abs(edge)) for edge in phi.reshape(-1, phi.shape[2])]
        l1 = sum(magnitudes)
        entropy = -sum(m / l1 * np.log(m / l1) for m in magnitudes)
        penalty += 0.14 * l1 + 0.17 * entropy
        nodes = phi.sum(axis=0)
    expected = np.mean((nodes[0] - target) ** 2) + 0.3 * penalty
    assert value == pytest.approx(expected, rel=1e-12)


def test_edges_that_are_all_zero_give_a_finite_penalty_and_gradient():
    layers, x, target = problem()
    loss = Loss(layers, x, target, STRONG)

    value, gradient = loss(np.zeros_like(parameters(layers)))

    assert np.isfinite(value)
    assert np.all(np.isfinite(gradient))


def test_parameters_go_to_a_row_and_back():
    layers, x, _ = problem()
    row = parameters(layers)

    again = with_parameters(layers, row)

    np.testing.assert_array_equal(parameters(again), row)
    np.testing.assert_array_equal(forward(again, x), forward(layers, x))


def test_directions_make_the_curvature_of_the_error_alike():
    layers, x, _ = problem((4, 1, 1), 2)
    start = parameters(layers)
    directions = gauss_newton_directions(layers, x)

    step = 1e-6
    # Change of the output along each of the best-determined directions, by finite differences.
    changes = np.stack(
        [
            (
                forward(with_parameters(layers, start + step * column), x)[0]
                - forward(with_parameters(layers, start - step * column), x)[0]
            )
            / (2.0 * step)
            for column in directions.T[-12:]
        ]
    )

    np.testing.assert_allclose(changes @ changes.T / x.shape[1], np.eye(12), atol=1e-4)


def test_descent_recovers_a_network_that_made_the_data():
    truth, x, _ = problem((4, 1, 1), 2, seed=3)
    target = forward(truth, x)[0]
    rng = np.random.default_rng(0)
    start = parameters(truth)
    layers = with_parameters(truth, start + 0.05 * rng.normal(size=start.size))
    loss = Loss(layers, x, target, NO_PENALTY)

    for _ in range(3):
        layers = descend(layers, loss, 40, gauss_newton_directions(layers, x))

    assert loss(parameters(layers))[0] < 1e-6 * np.var(target)
