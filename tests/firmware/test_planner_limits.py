"""The strength that a prediction rides, limit by limit, on constants whose roots are known."""

from __future__ import annotations

import math
from typing import Any

import pytest

from bms.firmware._firmware import ffi, lib
from tests.firmware.test_rcbf_edges import constants

STRONGEST_A = 20.0
FIRST_TRIED_A = 22.0 - 0.618034 * (22.0 - 0.4)
"""Golden section between 0.02 and 1.1 times the strongest."""
STILL = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
"""A cell whose temperatures stay."""
STEP_S = 1.0


def ridden_A(cell_changes: dict[str, Any], start_changes: dict[str, Any]) -> float:
    """The strength after the first period's steps, of a cell that hardly gets fuller."""
    cell = constants(alpha2_per_s=1.0, a1_per_s=1.0, alpha1_per_s=1e6, capacity_As=1e6)
    cell.max_core_temperature_K = cell.max_surface_temperature_K = (320.0, 0.0)
    cell.alpha3_per_s2 = 1e6
    for name, value in cell_changes.items():
        setattr(cell, name, value)
    fields = {"period_s": 0.1, "step_s": STEP_S, "growth_A": 100.0, "completion_soc": 1.0}
    plan = ffi.new("planner_constants_t *", {**fields, "response": STILL})
    planner = ffi.new("planner_t *")
    lib.planner_reset(planner)
    start = {
        "temperature_K": [-200.0, -200.0, -200.0],
        "soc": 0.5,
        "soc_per_As": 1e-9,
        "cooling_power_W": 0.5,
        "resistance_ohm": 0.01,
        "total_ohm": 0.01,
        "family_resistance_ohm": 0.01,
    }
    planner.start = {**start, **start_changes}
    planner.goal = {"strongest_A": STRONGEST_A, "time_left_s": -1.0}
    lib.planner_begin(planner)
    lib.planner_step(planner, plan, cell, ffi.new("family_constants_t *"))
    assert planner.is_searching and planner.trying == 0
    return float(planner.strength_A)


def test_where_nothing_limits_the_first_candidate_flows() -> None:
    assert ridden_A({}, {}) == pytest.approx(FIRST_TRIED_A, rel=1e-5)


def test_the_core_limits_by_its_room() -> None:
    """4 K of room, less 1 K of error where gains differ by 1, less 0.75 of the rest."""
    at = {"temperature_K": [-4.0, -4.0, -4.0]}
    assert ridden_A({}, at) == pytest.approx(2.0, rel=1e-5)
    errors = {"a1_per_s": 2.0, "estimation_error_bound_K": 1.0}
    assert ridden_A(errors, at) == pytest.approx(math.sqrt(3.0), rel=1e-5)
    margins = {"core_uncertainty_K_per_s": 0.5, "core_margin_K_per_s": 0.25}
    assert ridden_A(margins, at) == pytest.approx(math.sqrt(3.25), rel=1e-5)
    warmer = {"temperature_K": [-4.0, -6.0, -6.0]}
    assert ridden_A({}, warmer) == pytest.approx(math.sqrt(6.0), rel=1e-5)
    slope = {"a2_per_As": 3.0 / 316.0}
    assert ridden_A(slope, at) == pytest.approx(1.0, rel=1e-4), "v^2 + 3 v = 4"


def test_a_core_beyond_its_limit_gets_nothing() -> None:
    assert ridden_A({}, {"temperature_K": [0.01, 0.01, 0.01]}) == 0.0


@pytest.mark.parametrize(
    ("start", "constant"),
    [
        ({}, 11.25),
        ({"cooling_power_W": 4.0}, 10.25),
        ({"temperature_K": [-197.0, -200.0, -202.0]}, 13.25),
        ({"temperature_K": [-198.0, -200.0, -204.0]}, 10.25),
        ({"cooling_power_W": -7.0}, 0.0),
    ],
)
def test_the_surface_limits_as_in_its_equation(start: dict[str, Any], constant: float) -> None:
    """2 (Tc - Ts) + 0.5 (Tinf - Ts) + (limit - Ts) + P - 0.75 - v^2 is not below 0."""
    surface = {
        "max_surface_temperature_K": (124.0 + 0.0, 0.0),
        "alpha3_per_s2": 1.0,
        "a9_K_per_A2s2": -1.0,
        "a4_per_s2": 2.0,
        "a6_per_s2": 0.5,
        "delta4_K_per_s2": 0.5,
        "surface_margin_K_per_s2": 0.25,
        "a3_K_per_A2s": 1e-6,
    }
    known = {"temperature_K": [-198.0, -200.0, -202.0], "cooling_power_W": 5.0}
    assert ridden_A(surface, {**known, **start}) == pytest.approx(math.sqrt(constant), rel=1e-4)


def test_charge_and_voltage_limit_too() -> None:
    """In the middle of a step the charge still has to be within its condition."""
    charge = {"alpha1_per_s": 1e-5, "max_soc": 0.9, "soc_margin_per_s": 1e-6}
    charge |= {"soc_uncertainty_per_s": 1e-6}
    expected_A = 1e6 * (1e-5 * 0.4 - 2e-6) / (1.0 + 0.5e-5 * STEP_S)
    assert ridden_A(charge, {}) == pytest.approx(expected_A, rel=1e-4)
    voltage = {"max_voltage_V": 3.24, "voltage_margin_V": 0.02}
    assert ridden_A(voltage, {}) == pytest.approx(2.0, rel=1e-3), "20 mV over 10 milliohm"
