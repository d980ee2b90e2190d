"""Which networks the firmware takes: each condition broken once, alone, and its last good value."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from bms.firmware._firmware import ffi, lib

ONE = np.float32(1.0)
UNDER_ONE = float(np.nextafter(ONE, np.float32(0.0)))
UNDER_ZERO = float(np.nextafter(np.float32(0.0), np.float32(-1.0)))
NAN, INFINITE = float("nan"), float("inf")
COEFFICIENTS = 8
Change = Callable[[Any], None]


def network(widths: list[int], cells: int = 1, lags: int = 0, directions: int = 0) -> Any:
    """A network of zeros that is right in all but what its sizes may be wrong in."""
    model = ffi.new("kan_model_t *", {"layers": len(widths) - 1, "cells": cells, "lags": lags})
    model.width[0 : len(widths)] = widths
    model.directions = directions
    model.input_reach = 1.5
    for i in range(min(directions, 8)):
        model.direction[i].low, model.direction[i].high = -1.0, 1.0
    edges = sum(a * b for a, b in pairwise(widths))
    knots = np.linspace(-1.5, 1.5, cells + 1)
    numbers = np.tile(np.append(knots, np.zeros(cells * COEFFICIENTS)), edges)
    fitting = numbers[: len(model.tables)]
    model.tables[0 : len(fitting)] = fitting.tolist()
    return model


def accepts(model: Any) -> bool:
    """Whether the firmware takes it; a refused size has no length either."""
    return bool(lib.kan_model_is_valid(model))


@pytest.mark.parametrize(
    ("widths", "cells"),
    [([1, 1], 1), ([8, 1], 8), ([1, 1, 1, 1], 1), ([4, 8, 1], 1), ([1, 1], 64), ([7, 8, 1], 1)],
)
def test_sizes_up_to_the_maxima_are_taken(widths: list[int], cells: int) -> None:
    model = network(widths, cells)
    edges = sum(a * b for a, b in pairwise(widths))
    numbers = edges * (cells + 1 + COEFFICIENTS * cells)
    assert accepts(model)
    assert lib.kan_model_length(model) == ffi.offsetof("kan_model_t", "tables") + 4 * numbers


@pytest.mark.parametrize(
    ("widths", "cells"),
    [
        ([1], 1),
        ([1, 1, 1, 1], 0),
        ([0, 1], 1),
        ([9, 1], 1),
        ([4, 0, 1], 1),
        ([4, 9, 1], 1),
        ([4, 2], 1),
        ([1, 1], 65),
        ([1, 1], 127),
        ([1, 1], 128),
        ([1, 1], 2**32 - 1),
        ([8, 1], 9),
        ([8, 8, 1], 1),
    ],
)
def test_sizes_beyond_the_maxima_are_refused(widths: list[int], cells: int) -> None:
    model = network(widths, min(cells, 128))
    model.cells = cells
    assert not accepts(model)
    assert lib.kan_model_length(model) == 0


def test_more_layers_lags_or_directions_than_there_is_room_for_are_refused() -> None:
    for name, most in (("layers", 3), ("lags", 4), ("directions", 8)):
        model = network([8, 1, 1, 1], lags=4, directions=8)
        assert accepts(model), "the most of each"
        setattr(model, name, most + 1)
        assert not accepts(model), name
        assert lib.kan_model_length(model) == 0


def test_lagged_inputs_follow_the_measured_ones() -> None:
    assert accepts(network([3, 1])), "without lagged ones nothing is said of how many"
    assert accepts(network([6, 1], lags=2))
    assert not accepts(network([5, 1], lags=2))
    assert not accepts(network([7, 1], lags=2))


def lag(index: int, name: str, value: float) -> Change:
    return lambda model: setattr(model.lag[index], name, value)


def direction(index: int, name: str, value: float) -> Change:
    return lambda model: setattr(model.direction[index], name, value)


def component(index: int, value: float) -> Change:
    return lambda model: model.direction[index].component.__setitem__(7, value)


def member(name: str, value: float, index: int | None = None) -> Change:
    if index is None:
        return lambda model: setattr(model, name, value)
    return lambda model: getattr(model, name).__setitem__(index, value)


def nothing(_model: Any) -> None:
    pass


@pytest.mark.parametrize(
    "change",
    [
        nothing,
        lag(0, "quantity", 1),
        lag(1, "decay", 0.0),
        lag(1, "decay", UNDER_ONE),
        lag(0, "gain", -1e30),
        member("input_reach", 1.0),
        direction(0, "low", UNDER_ONE),
        component(1, 1e30),
        member("input_center", NAN, index=6),
        member("input_scale", INFINITE, index=6),
        member("tables", NAN, index=6 * 10),
    ],
)
def test_what_is_just_right_or_not_read_is_taken(change: Change) -> None:
    model = network([6, 1], lags=2, directions=2)
    change(model)
    assert accepts(model)


@pytest.mark.parametrize(
    "change",
    [
        *(lag(i, "quantity", 2) for i in (0, 1)),
        lag(0, "decay", UNDER_ZERO),
        lag(1, "decay", 1.0),
        lag(1, "decay", NAN),
        *(lag(1, "gain", value) for value in (NAN, INFINITE, -INFINITE)),
        *(member("input_reach", value) for value in (UNDER_ONE, NAN, INFINITE)),
        *(component(i, NAN) for i in (0, 1)),
        direction(1, "low", -INFINITE),
        direction(1, "high", INFINITE),
        direction(1, "low", 1.0),
        direction(1, "low", NAN),
        direction(1, "high", NAN),
        member("input_center", NAN, index=5),
        member("input_scale", INFINITE, index=5),
        member("output_center_K", INFINITE),
        member("output_half_range_K", NAN),
        member("tables", 1.5, index=0),
        member("tables", NAN, index=51),
        member("tables", INFINITE, index=59),
    ],
)
def test_each_number_that_is_wrong_alone_is_refused(change: Change) -> None:
    model = network([6, 1], lags=2, directions=2)
    change(model)
    assert not accepts(model)


@pytest.mark.parametrize(
    ("spans", "edge", "knots", "taken"),
    [
        (1, 1, (-1.5, 1.5), True),
        (1, 1, (-1.4, 1.5), False),
        (1, 1, (-1.5, 1.4), False),
        (0, 1, (-1.4, 1.4), True),
        (1, 2, (-1.4, 1.4), True),
    ],
)
def test_the_first_layer_spans_what_inputs_reach_where_it_says_so(
    spans: int, edge: int, knots: tuple[float, float], taken: bool
) -> None:
    model = network([2, 1, 1])
    model.spans_reach = spans
    model.tables[edge * 10 : edge * 10 + 2] = knots
    assert accepts(model) is taken


@pytest.mark.parametrize(
    ("x", "was_inside", "inside"),
    [
        (-1.5 - 5e-7, True, True),
        (-1.5 - 5e-7, False, False),
        (-1.5 - 2e-6, True, False),
        (1.5 + 5e-7, True, True),
        (1.5 + 5e-7, False, False),
        (1.5 + 2e-6, True, False),
        (NAN, True, False),
    ],
)
def test_an_edge_forgives_a_rounding_beyond_its_knots(
    x: float, was_inside: bool, inside: bool
) -> None:
    flag = ffi.new("bool *", was_inside)
    assert lib.kan_edge_value(network([1, 1]), 0, x, flag) == 0.0
    assert flag[0] is inside


@pytest.mark.parametrize(
    ("inputs", "inside"),
    [
        ((1.0, -1.0), True),
        ((1.0 + 5e-7, 0.0), True),
        ((0.0, -1.0 - 5e-7), True),
        ((1.0 + 5e-7, -1.0 - 5e-7), True),
        ((1.0 + 2e-6, 0.0), False),
        ((1.1, 1.0 + 5e-7), False),
        ((1.0 + 5e-7, 1.1), False),
        ((NAN, 0.0), False),
    ],
)
def test_a_network_forgives_a_rounding_beyond_the_box(
    inputs: tuple[float, float], inside: bool
) -> None:
    model = network([2, 1])
    model.input_scale[0:2] = [1.0, 1.0]
    assert lib.kan_evaluate(model, ffi.new("float[8]", list(inputs))).in_domain is inside
