"""The closed-form fit of networks with one hidden node."""

import numpy as np
import pytest

from bms.kan.additive import additive_layers
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import forward

RNG = np.random.default_rng(11)
X = RNG.uniform(-1.0, 1.0, (3, 4000))


def settings(grid=6, degree=3):
    return TrainingSettings(width=(3, 1, 1), grid=grid, degree=degree)


def error(layers, x, target):
    return np.sqrt(np.mean((forward(layers, x)[0] - target) ** 2))


@pytest.mark.parametrize("roughness", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_plane_is_reproduced_whatever_the_roughness_and_degree(roughness, degree):
    target = 0.3 + X.T @ np.array([0.5, -0.2, 0.1])
    assert error(additive_layers(X, target, settings(degree=degree), 1.0, roughness), X, target) < (
        1e-6
    )


def test_the_outer_function_bends_a_sum_that_is_additive_no_more():
    target = np.tanh(3.0 * (0.6 * np.sin(2.0 * X[0]) + 0.5 * X[1] ** 2))
    layers = additive_layers(X, target, settings(grid=8), 1.0, 1e-9)
    inner_only = forward(layers[:1], X)[0]
    assert error(layers, X, target) < 0.8 * np.sqrt(np.mean((inner_only - target) ** 2))


def test_roughness_gives_the_least_squares_plane_in_the_end():
    target = X[0] ** 3 + 0.1 * RNG.standard_normal(X.shape[1])
    design = np.vstack([np.ones(X.shape[1]), X]).T
    plane = design @ np.linalg.lstsq(design, target, rcond=None)[0]
    layers = additive_layers(X, target, settings(), 1.0, 1e8)
    assert forward(layers, X)[0] == pytest.approx(plane, abs=1e-4)


def test_functions_go_on_straight_beyond_the_data_as_far_as_they_reach():
    narrow = 0.5 * X
    target = 0.4 * narrow[0] - 0.3 * narrow[1]
    layers = additive_layers(narrow, target, settings(), 1.5, 1e-2)
    far = np.array([[1.4], [-1.4], [0.0]])
    assert forward(layers, far)[0] == pytest.approx([0.4 * 1.4 + 0.3 * 1.4], abs=1e-3)
