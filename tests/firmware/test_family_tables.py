"""Tables of a family and bounds on the heat in C, against numpy and the physics in doubles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.firmware.family_cell import FamilyCode, family_code

STRENGTHS = st.floats(0.0, 25.0, width=32)
TABLES = ("ocv_slope_V", "entropic_V_per_K")


@pytest.fixture(scope="module")
def code(tmp_path_factory: pytest.TempPathFactory) -> FamilyCode:
    return family_code(tmp_path_factory.mktemp("family"), "a123_26650")


@settings(max_examples=200, deadline=None)
@given(temperature_K=st.floats(250.0, 340.0), soc=st.floats(-0.1, 1.1))
def test_the_map_is_bilinear_and_goes_on_as_at_its_ends(
    code: FamilyCode, temperature_K: float, soc: float
) -> None:
    table = code.preset.current_map
    assert table is not None
    by_temperature = [np.interp(soc, table.soc, row) for row in table.largest_A]
    expected_A = np.interp(temperature_K, table.temperature_K, by_temperature)
    mapped_A = code.lib.family_mapped_A(code.ffi.addressof(code.k.map), temperature_K, soc)
    assert mapped_A == pytest.approx(expected_A, abs=2e-4)


def test_the_map_holds_each_of_its_points(code: FamilyCode) -> None:
    table = code.preset.current_map
    assert table is not None
    for temperature_K, row in zip(table.temperature_K, table.largest_A):
        for soc, largest_A in zip(table.soc, row):
            at = (code.ffi.addressof(code.k.map), temperature_K, soc)
            assert code.lib.family_mapped_A(*at) == pytest.approx(largest_A, abs=1e-4)


def greatest(code: FamilyCode, table: Any, low: float, high: float) -> float:
    """Of the cells of a table from one state of charge to another."""
    cell = code.lib.family_soc_cell
    return float(code.lib.family_greatest(table, cell(low), cell(high) + 1))


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(TABLES), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_greatest_of_a_table_is_that_of_all_cells_that_are_touched(
    code: FamilyCode, name: str, one: float, other: float
) -> None:
    low, high = np.float32(min(one, other)), np.float32(max(one, other))
    cells = np.array(list(getattr(code.k, name)))
    first, last = (min(int(at * len(cells)), len(cells) - 1) for at in (low, high))
    assert greatest(code, getattr(code.k, name), low, high) == cells[first : last + 1].max()


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 1.0), st.lists(st.tuples(st.floats(-400.0, 5.0), st.integers(1, 30))))
def test_a_charge_keeps_the_greatest_of_what_its_bounds_span_and_meets_the_next_cell_without_a_jump(
    code: FamilyCode, told_soc: float, parts: list[tuple[float, int]]
) -> None:
    family, reading = code.observer(), code.reading()
    code.observe(family, reading)
    code.begin(family, told_soc, reading)
    for current_A, periods in [*parts, (-200.0, 60)]:
        for _ in range(periods):
            code.observe(family, code.reading(current_A=current_A, command_A=current_A))
            if not family.soc_known:
                return
            rise = np.float32(code.k.hold_soc_per_A) * np.float32(family.strongest_A)
            high = np.float32(family.soc_high.soc) + rise
            for name in TABLES:
                cells = np.array(list(getattr(code.k, name)))
                first, last = (
                    min(int(at * len(cells)), len(cells) - 1) for at in (family.soc_low.soc, high)
                )
                greatest = cells[first : last + 1].max()
                rise = max(0.0, cells[min(last + 1, len(cells) - 1)] - greatest)
                quarters = np.clip(4.0 * (high * len(cells) - last) - 3.0, 0.0, 1.0)
                assert getattr(family, name) >= greatest
                assert getattr(family, name) == pytest.approx(
                    greatest + quarters * rise, abs=1e-5 * abs(cells).max()
                )


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_slope_and_entropy_of_a_table_are_nowhere_more(
    code: FamilyCode, one: float, other: float
) -> None:
    low, high = min(one, other), max(one, other)
    cell, interval = code.preset.cell, code.preset.cell.interval
    assert cell.entropy is not None and interval is not None
    inside = np.linspace(low, high, 50)
    slopes = np.diff(cell.ocv.voltage_V) / np.diff(cell.ocv.soc)
    segment = np.clip(np.searchsorted(cell.ocv.soc, inside, side="right") - 1, 0, len(slopes) - 1)
    entropy = np.interp(inside, cell.entropy.soc, cell.entropy.V_per_K)
    entropy = entropy + interval.entropic_error_V_per_K
    assert greatest(code, code.k.ocv_slope_V, low, high) >= slopes[segment].max()
    assert greatest(code, code.k.entropic_V_per_K, low, high) >= entropy.max()


@settings(max_examples=200, deadline=None)
@given(st.floats(260.0, 330.0), st.floats(0.0, 60.0))
def test_no_cell_at_a_temperature_or_above_has_more_resistance(
    code: FamilyCode, coldest_K: float, above_K: float
) -> None:
    table, interval = code.preset.cell.resistance, code.preset.cell.interval
    assert table is not None and interval is not None
    box_K = code.preset.operating_box.surface_temperature_K[0]
    at_K = max(coldest_K, box_K) + above_K
    ohm = np.interp(min(at_K, 323.0), table.temperature_K, [row[0] for row in table.ohm])
    assert code.lib.family_resistance_ohm(code.k, coldest_K) >= ohm * interval.resistance[1]
    assert code.k.least_resistance_ohm <= ohm * interval.resistance[0]


def histories() -> st.SearchStrategy[tuple[Any, ...]]:
    """Ohmic resistance, branches and the strengths that have flowed."""
    ohmic, branch = st.floats(0.008, 0.05), st.tuples(st.floats(0.0, 0.007), st.floats(5.0, 150.0))
    past = st.lists(st.tuples(STRENGTHS, st.floats(0.1, 60.0)), min_size=1, max_size=6)
    return st.tuples(ohmic, st.tuples(branch, branch), past, STRENGTHS)


def heat_of(code: FamilyCode, **changes: float) -> Any:
    return code.ffi.new(
        "family_heat_t *",
        {
            "overpotential_V": 0.2,
            "at_least_A": 9.95,
            "at_most_A": 10.05,
            "past_A": 10.05,
            "resistance_ohm": 0.0500001,
            "least_resistance_ohm": 0.0079999,
            "polarisation_ohm": 0.0140001,
            **changes,
        },
    )


def measured(code: FamilyCode, history: tuple[Any, ...], error_A: float) -> tuple[Any, list[float]]:
    """What is known after a history, and the branches' voltages."""
    ohmic_ohm, branches, past, _ = history
    volts = [0.0, 0.0]
    for strength_A, time_s in past:
        volts = [
            ohm * strength_A + (before - ohm * strength_A) * math.exp(-time_s / seconds)
            for before, (ohm, seconds) in zip(volts, branches)
        ]
    last_A = past[-1][0]
    known = heat_of(
        code,
        overpotential_V=ohmic_ohm * last_A + sum(volts) + 1e-6,
        at_least_A=max(last_A - error_A, 0.0),
        at_most_A=last_A + error_A,
        past_A=max(strength_A for strength_A, _ in past) + error_A,
    )
    return known, volts


@settings(max_examples=300, deadline=None)
@given(history=histories(), error_A=st.floats(0.001, 0.1))
def test_no_history_makes_more_heat_than_either_bound(
    code: FamilyCode, history: tuple[Any, ...], error_A: float
) -> None:
    known, volts = measured(code, history, error_A)
    ohmic_ohm, branches, _, next_A = history
    heat_W = ohmic_ohm * next_A**2 + sum(
        v**2 / ohm for v, (ohm, _) in zip(volts, branches) if ohm > 1e-6
    )
    assert code.lib.family_measured_heat_W(known, next_A) >= heat_W - 1e-5
    assert code.lib.family_assumed_heat_W(known, next_A) >= heat_W - 1e-5


def bounds(code: FamilyCode) -> Iterator[tuple[Any, Any]]:
    yield code.lib.family_measured_heat_W, code.lib.family_measured_strength_A
    yield code.lib.family_assumed_heat_W, code.lib.family_assumed_strength_A


@settings(max_examples=300, deadline=None)
@given(
    history=histories(),
    square=st.floats(0.0, 0.02),
    slope=st.floats(-0.15, 0.1),
    limit_W=st.floats(0.0, 30.0),
)
def test_the_strength_of_a_limit_is_the_largest_that_keeps_it(
    code: FamilyCode, history: tuple[Any, ...], square: float, slope: float, limit_W: float
) -> None:
    known, _ = measured(code, history, 0.05)
    for heat_W, strength_A in bounds(code):

        def left_W(at_A: float, heat_W: Any = heat_W) -> float:
            used_W = float(heat_W(known, at_A)) + slope * at_A + square * at_A**2
            return limit_W - used_W

        largest_A = strength_A(known, square, slope, limit_W)
        if largest_A >= 0.0:
            assert left_W(largest_A) >= -2e-4 * (1.0 + limit_W)
        # Used up there or above; where it cools, a stronger current may keep a limit of 0 again.
        end_A = max(largest_A, 0.0)
        left = [left_W(end_A + more_A) for more_A in (0.0, 0.05, 1.05, 5.05)]
        assert min(left) < 1e-4 * (1.0 + limit_W)


@pytest.mark.parametrize("limit_W", [-1.0, -1e-6, math.nan])
def test_without_a_limit_that_can_be_kept_there_is_no_strength(
    code: FamilyCode, limit_W: float
) -> None:
    known = heat_of(code)
    for _, strength_A in bounds(code):
        assert not strength_A(known, 0.0, 0.0, limit_W) >= 0.0


# Constants that may be 0, so that only less than nothing is wrong.
MAY_BE_ZERO = {
    *("plug_in_error", "ocv_error_V", "polarisation_ohm", "rest_polarisation_V"),
    *("rest_drift_per_s", "inner_K", "disturbance_W", "disturbance_W_per_A", "hold_W"),
    *("disturbance_W_per_A2", "per_surface_rise", "per_coolant_gap", "rest_error_K"),
    *("least_per_surface_rise", "most_per_surface_fall", "least_per_coolant_gap"),
    *("charge_error_K", "supply_tolerance", "current_error_A", "voltage_error_V"),
    *("surface_error_K", "coolant_error_K"),
}


def scalars(code: FamilyCode) -> Iterator[str]:
    for name, field in code.ffi.typeof("family_constants_t").fields:
        if field.type.kind == "primitive" and name != "is_stated":
            yield name


def refused(code: FamilyCode, name: str, value: Any) -> bool:
    changed = code.ffi.new("family_constants_t *", code.k[0])
    setattr(changed, name, value)
    return not code.lib.family_constants_are_valid(changed)


def test_the_constants_of_both_presets_are_valid(code: FamilyCode) -> None:
    for preset in ("a123_26650", "a123_26650_10C"):
        assert code.lib.family_constants_are_valid(code.of(preset).k)


def test_each_constant_that_makes_no_sense_is_refused(code: FamilyCode) -> None:
    counts = {"rest_periods", "charge_periods", "full_periods"}
    for name in scalars(code):
        if name in counts:
            assert refused(code, name, 0), name
        elif name == "branches":
            assert refused(code, name, 4)
        else:
            for value in (math.nan, math.inf, -1e-3):
                assert refused(code, name, value), (name, value)
            assert refused(code, name, 0.0) == (name not in MAY_BE_ZERO), name


def test_each_value_of_a_table_that_makes_no_sense_is_refused(code: FamilyCode) -> None:
    def spoiled(*path: Any, value: float) -> bool:
        changed = code.ffi.new("family_constants_t *", code.k[0])
        target = changed
        for step in path[:-1]:
            target = target[step] if isinstance(step, int) else getattr(target, step)
        if isinstance(path[-1], int):
            target[path[-1]] = value
        else:
            setattr(target, path[-1], value)
        return not code.lib.family_constants_are_valid(changed)

    for name in (*TABLES, "resistance_ohm"):
        for i in range(len(getattr(code.k, name))):
            assert spoiled(name, i, value=math.nan), (name, i)
    for i in range(1, len(code.k.resistance_ohm)):
        assert spoiled("resistance_ohm", i, value=1.0), "resistance falls with warmth"
    for i in range(code.k.branches):
        for name, value in (("slow", 0.0), ("fast", 1.1), ("slow", math.nan)):
            assert spoiled("branch", i, name, value=value)
        for name in ("resistance_ohm", "drift_ohm_per_s"):
            assert spoiled("branch", i, name, value=-1e-3)
            assert spoiled("branch", i, name, value=math.nan)
    map_points = code.k.map.temperatures * code.k.map.charges
    for i in range(map_points):
        assert spoiled("map", "strength_A", i, value=-0.1)
        assert spoiled("map", "strength_A", i, value=math.nan)
    assert spoiled("map", "temperature_K", 1, value=code.k.map.temperature_K[0])
    assert spoiled("map", "soc", 1, value=code.k.map.soc[0])
    assert spoiled("map", "temperatures", value=1) and spoiled("map", "charges", value=9)


def test_a_preset_of_one_cell_needs_no_family(code: FamilyCode) -> None:
    nothing = code.ffi.new("family_constants_t *", {"is_stated": 0})
    assert code.lib.family_constants_are_valid(nothing)


@pytest.mark.parametrize("name", ["overpotential_V", "at_least_A", "past_A", "resistance_ohm"])
def test_heat_that_is_no_number_leaves_no_strength(code: FamilyCode, name: str) -> None:
    fields = {
        "overpotential_V": 0.1,
        "at_least_A": 1.0,
        "past_A": 2.0,
        "resistance_ohm": 0.02,
        "least_resistance_ohm": 0.01,
        "polarisation_ohm": 0.01,
    }
    heat = code.ffi.new("family_heat_t *", {**fields, name: math.nan})
    assert code.lib.family_measured_strength_A(heat, 0.0, 0.0, 1.0) == -1.0
    sound = code.ffi.new("family_heat_t *", fields)
    assert code.lib.family_measured_strength_A(sound, 0.0, 0.0, 1.0) > 0.0


@pytest.mark.parametrize("slope", [-0.9, -1e-3, 0.0, 1e-3, 0.9])
def test_the_root_keeps_its_digits_whatever_the_sign_of_the_slope(
    code: FamilyCode, slope: float
) -> None:
    """A reversible heat that cools: 0.001 a^2 - 0.9 a = 1e-6 at 900 A, not at infinity."""
    square, limit_W = 1e-3, 1e-6
    fields = {"resistance_ohm": square, "least_resistance_ohm": square}
    heat = code.ffi.new("family_heat_t *", fields)
    exact = np.float64(np.float32(slope)), np.float64(np.float32(square))
    root = math.sqrt(exact[0] ** 2 + 4.0 * exact[1] * limit_W)
    expected_A = 2.0 * limit_W / (exact[0] + root) if slope > 0 else (root - exact[0]) / 2e-3
    strength_A = code.lib.family_measured_strength_A(heat, 0.0, slope, limit_W)
    assert strength_A == pytest.approx(expected_A, rel=1e-5)


def test_the_voltage_tells_the_charge_between_the_points_too(code: FamilyCode) -> None:
    points = code.cell.ocv_points
    soc = np.array(list(code.cell.ocv_soc)[:points], np.float64)
    voltage = np.array(list(code.cell.ocv_V)[:points], np.float64)
    for voltage_V in np.linspace(voltage[0] - 0.1, voltage[-1] + 0.1, 101):
        told = code.lib.family_soc_at(code.cell, voltage_V)
        assert told == pytest.approx(np.interp(voltage_V, voltage, soc), abs=1e-3)


@pytest.mark.parametrize("errors", [0.0, 0.5, 1.0, 3.0])
def test_what_flows_at_least_is_no_less_than_nothing(code: FamilyCode, errors: float) -> None:
    error_A = code.k.current_error_A
    heat = code.lib.family_heat(code.observer(), code.k, errors * error_A)
    assert heat.at_least_A == pytest.approx(max(errors - 1.0, 0.0) * error_A, abs=1e-7)
    assert heat.at_most_A == pytest.approx((errors + 1.0) * error_A, abs=1e-7)
