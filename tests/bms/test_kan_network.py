"""What a network computes, held against a plain scalar evaluation with SciPy's splines."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.interpolate import BSpline

from bms.errors import InputError
from bms.kan.network import Network
from tests.bms.kan_samples import random_network


def scalar_estimate(network: Network, inputs):
    """Core temperature and domain flag of one point, from the definition."""
    nodes, inside = [], True
    for value, center, half in zip(inputs, network.input_center, network.input_half_range):
        z = (value - center) / half
        inside = inside and -1.0 <= z <= 1.0
        nodes.append(min(max(z, -1.0), 1.0))
    for layer in network.layers:
        outputs = []
        for row in layer:
            total = 0.0
            for x, edge in zip(nodes, row):
                low, high = edge.knots[network.degree], edge.knots[-network.degree - 1]
                inside = inside and low <= x <= high
                at = min(max(x, low), high)
                spline = float(BSpline(edge.knots, edge.coefficients, network.degree)(at))
                total += edge.base_weight * at / (1.0 + math.exp(-at))
                total += edge.spline_weight * spline
            outputs.append(total)
        nodes = outputs
    return network.output_center_K + network.output_half_range_K * nodes[0], inside


@pytest.mark.parametrize(
    ("width", "grid", "degree"), [((4, 1, 1), 2, 3), ((4, 1), 1, 1), ((4, 3, 2, 1), 5, 2)]
)
def test_estimate_is_the_definition_inside_and_outside_the_box(width, grid, degree):
    network = random_network(width, grid, degree)
    rng = np.random.default_rng(1)
    z = rng.uniform(-1.3, 1.3, (300, 4))
    inputs = z * network.input_half_range + np.array(network.input_center)

    estimate_K, in_domain = network.evaluate(inputs)

    expected = [scalar_estimate(network, point) for point in inputs]
    np.testing.assert_allclose(estimate_K, [value for value, _ in expected], rtol=1e-12)
    assert in_domain.tolist() == [inside for _, inside in expected]
    assert 0 < np.count_nonzero(in_domain) < len(inputs)
    assert network.width == width


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_box_face_is_inside_and_just_beyond_is_clamped_and_flagged(column, side):
    # One layer only, so that no hidden grid can flag the face.
    network = random_network((4, 1))
    face = np.array([network.input_center])
    face[0, column] += side * network.input_half_range[column]
    beyond = face.copy()
    beyond[0, column] += side * 1e-6

    on_face_K, face_in_domain = network.evaluate(face)
    beyond_K, beyond_in_domain = network.evaluate(beyond)

    assert face_in_domain[0]
    assert not beyond_in_domain[0]
    assert beyond_K[0] == on_face_K[0]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_input_that_is_not_finite_is_flagged(value):
    network = random_network()
    inputs = np.array([network.input_center])
    inputs[0, 2] = value

    assert not network.evaluate(inputs)[1][0]


def test_shapes_that_do_not_fit_together_are_refused():
    network = random_network()
    edge = network.layers[0][0][0]
    broken_edges = {
        "coefficients": dataclasses.replace(edge, coefficients=edge.coefficients[:-1]),
        "too few knots": dataclasses.replace(edge, knots=edge.knots[:-2]),
        "falling knots": dataclasses.replace(edge, knots=edge.knots[::-1]),
    }
    for broken in broken_edges.values():
        layer = ((broken, *network.layers[0][0][1:]), *network.layers[0][1:])
        with pytest.raises(InputError, match=r"layers\.0"):
            dataclasses.replace(network, layers=(layer, *network.layers[1:]))
    with pytest.raises(InputError, match="4 edges"):
        dataclasses.replace(network, layers=network.layers[1:])
    with pytest.raises(InputError, match="one node"):
        dataclasses.replace(network, layers=network.layers[:1])
    with pytest.raises(InputError, match="at least one"):
        dataclasses.replace(network, layers=())
    with pytest.raises(InputError, match="differ in length"):
        dataclasses.replace(network, input_center=network.input_center[1:])
