"""The planned charge: near what no controller can beat, in time, and safe whatever the plan is."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bms.calibration.planner_block import planner_fields
from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from bms.presets import load_preset
from hil_sim.bus.catalog import Mode
from hil_sim.run.session import run_both
from tests.firmware.bench import HEALTHY, Bench, StepwiseEcu
from tests.firmware.planned_charge import charge, starting_at, time_s

PAPER, LIN = "paper_calibrated", "lin2014"

# Preset, start, lower bound on the time of every controller (s; a convex programme with the true
# states, without ramp and margins), and shares of it and of the fixed reference's time.
STARTS = [
    pytest.param(PAPER, None, 518.5, 1.02, 0.86, id="paper_calibrated from its start"),
    pytest.param(PAPER, 303.0, 930.3, 1.02, 0.72, id="paper_calibrated from 303 K"),
    pytest.param(PAPER, 313.0, 1421.7, 1.025, 0.85, id="paper_calibrated from 313 K"),
    pytest.param(LIN, None, 323.8, 1.02, 1.0, id="lin2014 from its start"),
    pytest.param(LIN, 313.0, 452.0, 1.035, 1.0, id="lin2014 from 313 K"),
]


@pytest.mark.parametrize(("preset", "start_K", "bound_s", "of_bound", "of_fixed"), STARTS)
def test_the_fastest_charge_is_near_the_bound_and_never_slower_than_the_fixed_one(
    preset: str, start_K: float | None, bound_s: float, of_bound: float, of_fixed: float
) -> None:
    fastest = time_s(charge(preset, start_K, Mode.FASTEST))
    fixed = time_s(charge(preset, start_K, Mode.FIXED))
    assert bound_s < fastest < of_bound * bound_s
    assert fastest <= of_fixed * fixed


def test_no_constant_reference_is_much_faster_than_the_planned_charge() -> None:
    others = [time_s(charge(PAPER, 303.0, strongest_A=-a)) for a in (7.7, 7.9, 8.1, 8.4)]
    assert time_s(charge(PAPER, 303.0, Mode.FASTEST)) < 1.005 * min(others)


WEAKLY_COOLED_BOUND_S = 1724.2
"""Of `bms optimum --preset paper_calibrated --start 313 --soc 0.01 --cooling 0.1152`."""


def test_a_plan_stays_in_force_until_a_better_one_is_found() -> None:
    """Hot and hardly cooled, the time has two least values over the strength."""
    settings = starting_at(PAPER, 313.0)
    cooling_W = 0.5 * settings.preset.initial.cooling_power_W
    initial = replace(settings.initial, soc=0.01, cooling_power_W=cooling_W)
    result = run_both(replace(settings, initial=initial, mode=Mode.FASTEST))
    assert WEAKLY_COOLED_BOUND_S < time_s(result) < 1.025 * WEAKLY_COOLED_BOUND_S


@pytest.mark.parametrize(
    ("preset", "start_K"), [(PAPER, None), (PAPER, 303.0), (LIN, None), (LIN, 313.0)]
)
def test_the_predicted_time_to_full_comes_true(preset: str, start_K: float | None) -> None:
    result = charge(preset, start_K, Mode.FASTEST)
    end_s, series = time_s(result), result.series
    told = [
        (time, predicted)
        for time, predicted in zip(series.time_s, series.predicted_time_to_full_s)
        if predicted is not None and 60.0 < time < end_s
    ]
    assert len(told) > 100
    # Of what is left, and the signal's step.
    assert all(abs(left - (end_s - time)) < 0.05 * (end_s - time) + 1.0 for time, left in told)


# The least is 1.06 times the bound; where ramp and margins alone take more, a little above that.
@pytest.mark.parametrize(
    ("preset", "start_K", "full_by_s"),
    [
        (PAPER, None, 560.0),
        (PAPER, None, 1000.0),
        (PAPER, 303.0, 1060.0),
        (LIN, None, 360.0),
        (LIN, None, 900.0),
        (LIN, 313.0, 480.0),
        (LIN, 313.0, 3000.0),
    ],
)
def test_a_charge_by_time_is_full_in_time_and_cooler_than_the_fastest(
    preset: str, start_K: float | None, full_by_s: float
) -> None:
    in_time = charge(preset, start_K, Mode.BY_TIME, full_by_s)
    fastest = charge(preset, start_K, Mode.FASTEST)
    assert time_s(in_time) == pytest.approx(full_by_s, rel=0.01)
    assert in_time.summary.max_core_temperature_K < fastest.summary.max_core_temperature_K


def test_a_time_that_cannot_be_kept_gives_the_fastest_charge() -> None:
    late = charge(LIN, 313.0, Mode.BY_TIME, 100.0)
    assert time_s(late) == pytest.approx(time_s(charge(LIN, 313.0, Mode.FASTEST)), rel=0.002)


NOT_FINITE = [math.nan, math.inf, -math.inf]


class NoisyEcu(StepwiseEcu):
    """An ECU whose plan is noise, another in every period, numbers that are none among it."""

    def __init__(self, preset: str) -> None:
        super().__init__(preset)
        self.rng = random.Random(14)
        self.periods = 0

    def step(self) -> None:
        """Run one control period."""
        self.periods += 1
        planner = self._state.planner
        planner.is_searching, planner.age_s = False, 0.0
        planner.planned_A = self.rng.choice(
            [self.rng.uniform(-60.0, 60.0), *NOT_FINITE, 1e30, -1e30]
        )
        super().step()


@pytest.mark.parametrize(("preset", "start_K"), [(PAPER, 317.0), (LIN, 317.0)])
def test_with_noise_for_a_plan_every_limit_is_kept(preset: str, start_K: float) -> None:
    settings = replace(starting_at(preset, start_K), mode=Mode.FASTEST, max_time_s=400.0)
    ecu = NoisyEcu(preset)
    noisy = run_both(settings, ecu_factory=lambda plant, database: ecu).summary
    assert ecu.periods > 1000
    assert (noisy.limits_kept, noisy.first_fault) == (True, None)
    assert noisy.final_soc > settings.preset.initial.soc + 0.02, "it did charge"


@pytest.mark.parametrize("planned_A", [*NOT_FINITE, -1.0, -1e30, 23.5, 1e30])
def test_a_plan_is_never_more_than_the_reference(planned_A: float) -> None:
    planner = ffi.new("planner_t *", {"planned_A": planned_A})
    assert lib.planner_reference_A(planner, -23.0) == -23.0


def test_a_weaker_plan_takes_the_place_of_the_reference() -> None:
    planner = ffi.new("planner_t *", {"planned_A": 7.5})
    assert lib.planner_reference_A(planner, -23.0) == -7.5
    assert lib.planner_reference_A(planner, -5.0) == -5.0


START: dict[str, Any] = {
    "temperature_K": [-20.0, -20.0, -20.0],
    "soc": 0.1,
    "strength_A": 0.0,
    "cooling_power_W": 0.2,
    "soc_per_As": 1.0 / 8280.0,
    "resistance_ohm": 0.0125,
    "total_ohm": 0.0125,
    "entropic_V": 0.1,
}
GOAL = {"strongest_A": 23.0, "time_left_s": -1.0}


def begun(start: dict[str, Any], goal: dict[str, float], planned_A: float = 8.0) -> Any:
    planner = ffi.new("planner_t *")
    lib.planner_reset(planner)
    planner.start, planner.goal, planner.planned_A = start, goal, planned_A
    lib.planner_begin(planner)
    return planner


@pytest.mark.parametrize("value", NOT_FINITE)
@pytest.mark.parametrize("name", [*START, *GOAL])
def test_readings_that_are_no_number_leave_no_plan(name: str, value: float) -> None:
    changed = [value] * 3 if name == "temperature_K" else value
    start = {**START, name: changed} if name in START else START
    planner = begun(start, {**GOAL, name: value} if name in GOAL else GOAL)
    assert not planner.is_searching
    assert math.isnan(planner.planned_A)


@pytest.mark.parametrize("planned_A", [0.01, 0.2, 8.0, 23.0, math.nan])
def test_a_search_is_among_currents_that_the_charger_asks_for(planned_A: float) -> None:
    """Also when it has asked for much more until now."""
    planner = begun(START, {**GOAL, "strongest_A": 8.0}, planned_A)
    assert 0.0 < planner.low_A < 0.5 * planner.high_A
    assert planner.low_A <= 0.5 * 8.0


def test_a_period_takes_no_more_steps_than_it_may_and_a_search_ends() -> None:
    calibration = Ecu(PAPER)._calibration
    planner = begun(START, GOAL)
    most_s, periods = lib.PLANNER_STEPS * 5.0, 0
    while planner.is_searching:
        tried, trying, elapsed_s = planner.tried, planner.trying, planner.elapsed_s
        lib.planner_step(
            planner, ffi.addressof(calibration, "planner"),
            ffi.addressof(calibration, "rcbf"), ffi.addressof(calibration, "family"),
        )  # fmt: skip
        periods += 1
        assert planner.tried - tried <= 2
        if (planner.tried, planner.trying) == (tried, trying):
            assert planner.elapsed_s - elapsed_s == most_s
    assert (planner.tried, periods < 250) == (14, True)
    assert 1.0 < planner.planned_A < 23.0
    assert 300.0 < planner.time_to_full_s < 4000.0


def test_two_charges_are_the_same_to_the_last_bit() -> None:
    first, second = (replace(starting_at(PAPER, 310.0), mode=Mode.FASTEST, max_time_s=60.0),) * 2
    assert run_both(first).series == run_both(second).series


def test_a_mode_that_goes_away_ends_the_plan() -> None:
    bench = Bench(values={**HEALTHY, "Mode": float(Mode.BY_TIME), "TimeToFull": 2400.0})
    bench.start()
    for _ in range(150):
        bench.period()
    assert bench.command_A == pytest.approx(-1.72, abs=0.1)
    # The rest until the message counts as gone, at 0.138 A a period.
    for _ in range(90):
        bench.period(drop=("ChargeMode",))
    assert bench.command_A < -10.0


def test_a_step_of_the_prediction_is_that_of_the_cell_s_own_equations() -> None:
    """Against small steps of the equations themselves, without a matrix exponential."""
    preset = load_preset(LIN)
    cell, fields = preset.cell, planner_fields(preset)
    heat_W, cooling_W, steps = 5.0, 1.0, 20000
    start = np.array([10.0, 4.0, -3.0])
    core, surface, coolant = start
    step_s = fields["step_s"] / steps
    for _ in range(steps):
        inner_W = (core - surface) / cell.core_resistance_K_per_W
        outer_W = (surface - coolant) / cell.surface_resistance_K_per_W
        core += step_s * (heat_W - inner_W) / cell.core_heat_capacity_J_per_K
        surface += step_s * (inner_W - outer_W) / cell.surface_heat_capacity_J_per_K
        coolant += step_s * (outer_W - cooling_W) / cell.coolant_heat_capacity_J_per_K
    exact = np.reshape(fields["response"], (3, 5)) @ [*start, heat_W, cooling_W]
    assert exact == pytest.approx([core, surface, coolant], abs=1e-3)
