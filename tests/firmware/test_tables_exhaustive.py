"""Edge functions in C against double precision: a strided part of all arguments, quickly.

`make verify-tables` tries all 2^32 of them.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.firmware import CompiledNetwork
from bms.firmware.edges import CompiledEdges
from bms.kan.network import Network
from bms.model.model_file import load_model, save_model, shipped_models
from bms.tables.rounding import arithmetic_error_K, edge_error_bounds
from bms.verification.exhaustive import EdgeSweep, check_network
from tests.firmware.test_kan import box_points, random_model

MODELS = pytest.mark.parametrize("path", shipped_models(), ids=lambda path: path.stem)
STRIDE = 8191
SHAPES = st.sampled_from(
    [((4, 1, 1), 2, 3), ((4, 2, 1), 5, 3), ((4, 1), 7, 2), ((4, 2, 2, 1), 2, 4)]
)


def nudged(network: Network, number: int, change: float) -> Network:
    """The network with one spline coefficient of one edge changed."""
    edges = iter(range(len(network.edges)))

    def edge(old):
        if next(edges) != number:
            return old
        return replace(old, coefficients=(*old.coefficients[:-1], old.coefficients[-1] + change))

    layers = tuple(tuple(tuple(edge(e) for e in row) for row in layer) for layer in network.layers)
    return replace(network, layers=layers)


def test_bounds_of_all_shipped_models_hold(bms):
    code, out, _ = bms("verify-tables", "--stride", STRIDE, "--json")

    result = json.loads(out)
    edges = sum(len(load_model(path).network.edges) for path in shipped_models())
    assert code == 0
    assert len(result["edges"]) == edges
    for row in result["edges"]:
        assert 0.0 < row["worst_error"] <= row["error_bound"]
        assert row["arguments"] > 2**32 / STRIDE
        assert row["wrong_flags"] == 0


def test_bound_below_the_worst_error_is_found_out(bms, tmp_path):
    model = load_model(shipped_models()[0])
    lowered = (*model.edge_error_bounds[:-1], 0.1 * model.edge_error_bounds[-1])
    save_model(replace(model, edge_error_bounds=lowered), tmp_path / "model.json")

    code, out, _ = bms("verify-tables", "--model", tmp_path / "model.json")

    assert code == 1
    assert "do NOT hold" in out


def test_model_that_states_no_bounds_is_refused(bms, tmp_path):
    model = replace(load_model(shipped_models()[0]), edge_error_bounds=())
    save_model(model, tmp_path / "model.json")

    code, _, err = bms("verify-tables", "--model", tmp_path / "model.json")

    assert code == 2
    assert "model.json" in err


@MODELS
def test_one_wrong_coefficient_of_one_edge_shows(path):
    network = load_model(path).network
    bounds = edge_error_bounds(network)
    for number, bound in enumerate(bounds):
        wrong = CompiledEdges(nudged(network, number, 20.0 * max(bounds)))

        assert EdgeSweep(network, number, wrong).check_some(2**21 + 1).worst_error > bound


@MODELS
def test_grid_that_is_shifted_by_a_little_more_than_its_tolerance_shows_in_the_flags(path):
    network = load_model(path).network
    hidden = network.layers[-1][0][0]
    shifted = replace(hidden, knots=tuple(knot + 3e-6 for knot in hidden.knots))
    layers = (*network.layers[:-1], ((shifted,),))
    last = len(network.edges) - 1

    check = EdgeSweep(network, last, CompiledEdges(replace(network, layers=layers))).check_some(
        2**21 + 1
    )

    assert check.wrong_flags > 0
    assert check.wrong_flag_argument is not None
    ends = np.array(hidden.knots)[[network.degree, -network.degree - 1]]
    assert np.min(np.abs(check.wrong_flag_argument - ends)) < 1e-5


@MODELS
def test_quick_reference_is_the_edge_itself(path):
    network = load_model(path).network
    random = np.random.default_rng(2)
    firsts = [
        *random.integers(0x3A00, 0x3F90, 40) * 2**16,  # 1e-3 to 1.1
        *random.integers(0, 2**15, 20) * 2**16,  # any magnitude
        0x7F80_0000,  # infinity, then NaNs
    ]
    for number in range(len(network.edges)):
        sweep = EdgeSweep(network, number)
        for first in [*firsts, *(2**31 + int(first) for first in firsts)]:
            patterns = np.arange(first, int(first) + 2**16, 31).astype(np.uint32)
            with np.errstate(invalid="ignore"):  # NaNs
                x = patterns.view(np.float32).astype(np.float64)
            assert np.max(np.abs(sweep.reference(x) - sweep.exact(x))) <= 1e-13


@MODELS
@pytest.mark.parametrize(
    "first",
    [
        0x0000_0000,  # zero, then denormals
        0x8000_0000,
        0x3F80_0000 - 2**15,  # around 1
        0xBF80_0000 - 2**15,
        0x7F80_0000 - 2**15,  # the largest numbers, infinity, NaNs
        0xFF80_0000 - 2**15,
        0x7FFF_0000,  # the last NaNs
    ],
)
def test_runs_of_neighbouring_arguments_hold(path, first):
    network = load_model(path).network
    bounds = edge_error_bounds(network)
    for number, bound in enumerate(bounds):
        check = EdgeSweep(network, number).check_all(first, first + 2**16)

        assert check.arguments == 2**16
        assert check.worst_error <= bound
        assert check.wrong_flags == 0


@given(shape=SHAPES, seed=st.integers(0, 10_000))
@settings(max_examples=5)
def test_bounds_of_any_network_hold(shape, seed):
    network = random_model(*shape, seed=seed).network

    checks = check_network(network, 2**23 + 1, 1)

    for check, bound in zip(checks, edge_error_bounds(network), strict=True):
        assert check.worst_error <= bound
        assert check.wrong_flags == 0


@given(shape=SHAPES, seed=st.integers(0, 10_000))
@settings(max_examples=5)
def test_bound_of_the_whole_estimate_holds_for_any_network(shape, seed):
    model = random_model(*shape, seed=seed)
    points = box_points(model.network, 4000, seed)

    in_c, _ = CompiledNetwork(model).evaluate(points)

    error_K = np.abs(in_c - model.network.evaluate(points)[0])
    assert np.max(error_K) <= arithmetic_error_K(model.network)


@MODELS
def test_stated_arithmetic_error_holds_over_the_box(path):
    model = load_model(path)
    points = box_points(model.network, 300_000, seed=4)

    in_c, _ = CompiledNetwork(model).evaluate(points)

    error_K = np.max(np.abs(in_c - model.network.evaluate(points)[0]))
    assert error_K <= model.error_bound_parts_K["arithmetic"] <= 1e-3
