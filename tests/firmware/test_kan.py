"""The estimator in C against the network in exact arithmetic, and the domain it trusts."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.errors import InputError
from bms.firmware import CompiledNetwork, Firmware
from bms.firmware._firmware import ffi, lib
from bms.kan.network import Edge, Network
from bms.model.model_file import KanModel, load_model, load_shipped_model, shipped_model_path
from bms.tables import network_tables

PRESETS = ("lin2014", "paper_calibrated")
POINTS = 1_000_000


@cache
def lin2014() -> Firmware:
    return Firmware("lin2014")


def box_points(network: Network, count: int, seed: int) -> np.ndarray:
    """Random points of the box, half of them on one of its faces."""
    random = np.random.default_rng(seed)
    unit = random.uniform(-1, 1, (count, len(network.input_names)))
    half = count // 2
    face = random.integers(0, unit.shape[1], half)
    unit[np.arange(half), face] = random.choice([-1.0, 1.0], half)
    return np.asarray(network.input_center) + unit * np.asarray(network.input_half_range)


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_c_and_python_agree_over_the_box_and_its_faces(preset: str) -> None:
    model = load_shipped_model(preset)
    points = box_points(model.network, POINTS, seed=1)
    in_c, _ = CompiledNetwork(model).evaluate(points)
    in_python, _ = model.network.evaluate(points)
    assert np.max(np.abs(in_c - in_python)) <= 1e-3


def random_model(width: tuple[int, ...], grid: int, degree: int, seed: int) -> KanModel:
    """A network of any shape with coefficients and knots drawn at random."""
    random = np.random.default_rng(seed)

    def edge() -> Edge:
        steps = np.concatenate([np.full(degree, 0.5), random.uniform(0.5, 1, grid), [0.5] * degree])
        knots = np.concatenate([[0.0], np.cumsum(steps)])
        knots = (knots - knots[degree]) / (knots[-degree - 1] - knots[degree]) * 2 - 1
        return Edge(
            tuple(knots.tolist()),
            float(random.normal()),
            float(random.normal()),
            tuple(random.normal(size=grid + degree).tolist()),
        )

    layers = tuple(
        tuple(tuple(edge() for _ in range(before)) for _ in range(after))
        for before, after in pairwise(width)
    )
    shipped = load_shipped_model("lin2014")
    return replace(shipped, network=replace(shipped.network, degree=degree, layers=layers))


@pytest.mark.parametrize(
    ("width", "grid", "degree"),
    [((4, 1, 1), 2, 3), ((4, 2, 1), 5, 3), ((4, 1), 7, 2), ((4, 3, 2, 1), 2, 4), ((4, 5, 1), 2, 3)],
)
def test_any_shape_that_fits_gives_the_same_in_c(
    width: tuple[int, ...], grid: int, degree: int
) -> None:
    model = random_model(width, grid, degree, seed=grid)
    points = box_points(model.network, 20_000, seed=2)
    in_c, _ = CompiledNetwork(model).evaluate(points)
    in_python, _ = model.network.evaluate(points)
    span_K = 2 * model.network.output_half_range_K
    assert np.max(np.abs(in_c - in_python)) <= 1e-4 * span_K


@pytest.mark.parametrize(
    ("width", "grid"), [((4, 9, 1), 2), ((4, 8, 8, 1), 2), ((4, 1, 1, 1, 1), 2), ((4, 1, 1), 40)]
)
def test_what_exceeds_the_maxima_is_refused(width: tuple[int, ...], grid: int) -> None:
    with pytest.raises(InputError, match="exceeds the firmware's"):
        CompiledNetwork(random_model(width, grid, 3, seed=0))


@pytest.mark.parametrize(("end", "by"), [(0, 1e-3), (-1, -1e-3)])
@pytest.mark.parametrize("edge", range(4))
def test_first_knots_that_inputs_reach_beyond_are_refused(edge: int, end: int, by: float) -> None:
    block = ffi.new("bms_calibration_t *", lib.host_default_calibration()[0])
    kan = block.kan
    assert lib.kan_model_is_valid(ffi.addressof(kan))
    numbers = kan.cells + 1 + 8 * kan.cells
    at = edge * numbers + (0 if end == 0 else kan.cells)
    kan.tables[at] += by
    assert not lib.kan_model_is_valid(ffi.addressof(kan))
    kan.tables[at] -= 2 * by
    assert lib.kan_model_is_valid(ffi.addressof(kan))
    kan.input_reach += 0.01
    assert not lib.kan_model_is_valid(ffi.addressof(kan))
    # Not where nothing is said of them: then every input is held within its knots.
    kan.spans_reach = 0
    assert lib.kan_model_is_valid(ffi.addressof(kan))


@pytest.mark.parametrize("preset", PRESETS)
def test_stated_table_error_holds_over_every_edge(preset: str) -> None:
    network = load_shipped_model(preset).network
    tables = network_tables(network)
    assert tables.error_bound_K <= 1e-4
    edges = network.edges
    for edge, table in zip(edges, tables.edges):
        x = np.linspace(table.knots[0], table.knots[-1], 10_001)
        cell = np.clip(np.searchsorted(table.knots, x, side="right") - 1, 0, tables.cells - 1)
        distance = x - 0.5 * (table.knots[cell] + table.knots[cell + 1])
        polynomial = sum(table.coefficients[cell, i] * distance**i for i in range(8))
        expected, _ = edge.evaluate(x, network.degree)
        assert np.max(np.abs(polynomial - expected)) <= table.worst_error + 1e-12


INSIDE = {
    "current_A": -10.0,
    "cooling_power_W": 0.5,
    "surface_temperature_K": 305.0,
    "coolant_temperature_K": 300.0,
}


def test_estimate_inside_the_box_is_trusted() -> None:
    assert lin2014().estimate(**INSIDE).in_domain


@given(name=st.sampled_from(sorted(INSIDE)), high=st.booleans(), beyond=st.floats(0.01, 1e6))
def test_estimate_outside_the_box_is_flagged_and_clamped(
    name: str, high: bool, beyond: float
) -> None:
    firmware = lin2014()
    low_end, high_end = getattr(firmware.preset.operating_box, name)
    edge = {**INSIDE, name: high_end if high else low_end}
    outside = {**INSIDE, name: high_end + beyond if high else low_end - beyond}
    estimate = firmware.estimate(**outside)
    assert not estimate.in_domain
    assert estimate.core_temperature_K == pytest.approx(
        firmware.estimate(**edge).core_temperature_K, abs=1e-4
    )


def test_a_combination_never_seen_is_flagged_though_each_value_is_in_its_range() -> None:
    torn = {**INSIDE, "current_A": -14.7, "surface_temperature_K": 304.0}
    torn["coolant_temperature_K"] = 321.0
    box = lin2014().preset.operating_box
    assert all(
        getattr(box, name)[0] < value < getattr(box, name)[1] for name, value in torn.items()
    )
    assert not lin2014().estimate(**torn).in_domain


@pytest.mark.parametrize("lagged", [False, True])
@pytest.mark.parametrize("preset", PRESETS)
def test_c_and_python_flag_the_same_points(preset: str, lagged: bool) -> None:
    model = load_model(shipped_model_path(preset, lagged))
    points = box_points(model.network, 100_000, seed=3)
    in_c = CompiledNetwork(model).evaluate(points)[1]
    in_python = model.network.evaluate(points)[1]
    # Points on a face of the box or of a slab may fall on either side of it in float32.
    random = slice(50_000, None)
    assert np.mean(in_c[random] != in_python[random]) < 1e-4
    assert 0.02 < np.mean(in_python[random]) < 0.98


@given(name=st.sampled_from(sorted(INSIDE)), bad=st.sampled_from([math.nan, math.inf, -math.inf]))
def test_input_that_is_not_finite_is_flagged(name: str, bad: float) -> None:
    estimate = lin2014().estimate(**{**INSIDE, name: bad})
    assert not estimate.in_domain
    assert math.isfinite(estimate.core_temperature_K)
