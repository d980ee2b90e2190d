"""`bms verify`: what it certifies, what it must not, and the pieces that its argument rests on."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from typer import Typer
from typer.testing import CliRunner

from bms.barrier.margins import decision_allowances
from bms.barrier.readings import reading_errors
from bms.barrier.rounding import ARITHMETIC_ROUNDINGS
from bms.bus_signals import BUS
from bms.cell import CellState, Disturbance, integrate_step, rates
from bms.commands.verify import verify as command
from bms.firmware import Firmware
from bms.model.pair import load_pair
from bms.presets import load_preset, one_cell_preset_names
from bms.presets.paper_form import in_paper_form
from bms.verification import SLIPS, Verification, verify
from bms.verification.barriers import Barrier
from bms.verification.conditions import (
    chains,
    decided_conditions,
    firmware_constants,
    required_conditions,
)
from bms.verification.decision import decide
from bms.verification.domain import certified_domain
from bms.verification.fallback import infeasible_part, thermal_response
from bms.verification.intervals import Interval
from bms.verification.search import CounterExample
from bms.verification.thermal import Case, certify, held_integral
from bms.verification.verify import thermal_cases

NAMES = one_cell_preset_names()
TIME_LIMIT_S = 60.0


@cache
def corrected(name: str) -> Verification:
    return verify(*load_pair(name, None))


@cache
def printed(name: str) -> Verification:
    preset, model = load_pair(name, None)
    return verify(in_paper_form(preset), model, SLIPS, largest_boxes=50_000)


def counter_examples(result: Verification) -> list[CounterExample]:
    return [b.counter_example for b in result.barriers if b.counter_example is not None]


@pytest.mark.parametrize("name", NAMES)
def test_the_shipped_presets_are_certified(name):
    result = corrected(name)

    assert result.certified
    assert result.wall_time_s < TIME_LIMIT_S
    assert counter_examples(result) == []
    assert all(b.certificate.boxes > 0 and b.certificate.open_boxes == 0 for b in result.barriers)


@pytest.mark.parametrize("name", NAMES)
def test_the_printed_formulas_yield_a_safe_state_that_fails_in_simulation(name):
    result = printed(name)
    preset = in_paper_form(load_preset(name))
    limits, bounds = preset.limits, preset.uncertainty

    examples = counter_examples(result)

    assert not result.certified
    assert examples
    for example in examples:
        first = next(
            c.first_per_s
            for c in chains(preset)
            if example.barrier != "surface" or f"{c.first_per_s:.3g}" in _name_of(result, example)
        )
        start = np.array(
            [
                example.core_temperature_K,
                example.surface_temperature_K,
                example.coolant_temperature_K,
            ]
        )

        def disturbed(time_s, surface_start):
            return Disturbance(
                0.0,
                bounds.core_K_per_s,
                min(surface_start + bounds.surface_rate_K_per_s2 * time_s, bounds.surface_K_per_s),
                bounds.coolant_K_per_s,
            )

        surface_start = -bounds.surface_K_per_s if example.barrier == "surface" else 0.0

        def slope(time_s, temperatures, example=example, surface_start=surface_start):
            return rates(
                preset.cell,
                CellState(0.5, *temperatures),
                example.current_A,
                example.cooling_power_W,
                disturbed(time_s, surface_start),
            )[1:]

        def barrier(time_s, temperatures, example=example, slope=slope, first=first):
            if example.barrier == "core":
                return limits.max_core_temperature_K - temperatures[0]
            room_K = limits.max_surface_temperature_K - temperatures[1]
            return first * room_K - slope(time_s, temperatures)[1]

        run = solve_ivp(slope, (0.0, example.hold_s), start, max_step=1e-3, rtol=1e-11, atol=1e-11)
        values = [barrier(t, x) for t, x in zip(run.t, run.y.T)]
        assert values[0] > -1e-9
        assert min(values) < 0.0
        assert min(values) == pytest.approx(example.value, rel=0.05, abs=1e-6)


def _name_of(result: Verification, example: CounterExample) -> str:
    return next(b.name for b in result.barriers if b.counter_example is example)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("margin", ["core_margin_K_per_s", "surface_margin_K_per_s2"])
def test_a_quarter_of_a_margin_is_not_certified(name, margin):
    preset, model = load_pair(name, None)
    constants = firmware_constants(preset, model)
    constants[margin] *= 0.25
    index = 0 if margin.startswith("core") else 1
    condition = required_conditions(preset)[index]
    chain = chains(preset)[1]
    decay_per_s = preset.gains.core_gain_per_s(preset.cell) if index == 0 else chain.second_per_s
    case = Case(
        (Barrier.CORE, Barrier.SURFACE)[index],
        condition,
        decided_conditions(constants)[index],
        decay_per_s,
        decision_allowances(preset.cell, preset, BUS, ARITHMETIC_ROUNDINGS)[index + 2],
    )

    certificate = certify(
        certified_domain(preset, condition, chain), case, reading_errors(preset), 50_000
    )

    assert not certificate.holds
    assert certificate.open_low is not None


def test_a_condition_that_is_no_number_is_not_certified():
    preset, model = load_pair("lin2014", None)
    (domain, case), *_ = thermal_cases(preset, firmware_constants(preset, model))

    certificate = certify(domain, replace(case, allowance=np.nan), reading_errors(preset), 1_000)

    assert not certificate.holds


@pytest.mark.parametrize("name", NAMES)
def test_states_beyond_the_domain_that_fail_do_lie_beyond_it(name):
    failing = [b for b in corrected(name).barriers if b.outside is not None]

    assert failing, "the domain would be needlessly narrow"
    for barrier in failing:
        example = barrier.outside
        gaps = (
            example.core_temperature_K - example.surface_temperature_K,
            example.surface_temperature_K - example.coolant_temperature_K,
        )
        assert any(flow.rate(*gaps) > flow.largest for flow in barrier.domain.flows)


@pytest.mark.parametrize("name", NAMES)
def test_flows_of_random_charges_stay_in_the_domain(name):
    preset = load_preset(name)
    random = np.random.default_rng(5)
    domains = [certified_domain(preset, c, chains(preset)[0]) for c in required_conditions(preset)]
    count = 200
    start_K = np.full(count, 295.0)
    state = CellState(np.full(count, 0.1), start_K, start_K, start_K)
    b = preset.uncertainty
    bounds = np.array([0.0, b.core_K_per_s, b.surface_K_per_s, b.coolant_K_per_s])
    for _ in range(300):
        current_A = random.choice([0.0, -10.0, -23.0], count)
        cooling_W = random.choice(preset.operating_box.cooling_power_W, count)
        signs = random.choice([-1.0, 1.0], (4, count))
        for _ in range(10):
            state = integrate_step(
                preset.cell, state, current_A, cooling_W, 0.2, Disturbance(*(signs.T * bounds).T)
            )
        cool = state.core_temperature_K < preset.limits.max_core_temperature_K
        core_gap = (state.core_temperature_K - state.surface_temperature_K)[cool]
        coolant_gap = (state.surface_temperature_K - state.coolant_temperature_K)[cool]
        for flow in (flow for domain in domains for flow in domain.flows):
            assert np.all(flow.rate(core_gap, coolant_gap) <= flow.largest + 1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_the_decision_that_is_reasoned_about_is_the_firmwares(name):
    preset, model = load_pair(name, None)
    firmware, constants = Firmware(preset, model), firmware_constants(preset, model)
    random = np.random.default_rng(11)
    feasible = 0
    for _ in range(2000):
        surface_K = random.uniform(285.0, 323.0)
        reading = CellState(
            random.uniform(0.0, 0.99),
            surface_K + random.uniform(-1.0, 10.0),
            surface_K,
            surface_K - random.uniform(-1.0, 20.0),
        )
        lower_A, upper_A, active = decide(constants, reading, 0.5, -23.0)
        decision = firmware.solve(
            soc=reading.soc + constants["soc_error"],
            core_temperature_K=reading.core_temperature_K,
            surface_temperature_K=surface_K,
            coolant_temperature_K=reading.coolant_temperature_K,
            cooling_power_W=0.5,
            reference_current_A=-23.0,
        )
        if abs(upper_A - lower_A) < 1e-3:
            continue
        assert decision.feasible == bool(lower_A <= upper_A)
        if decision.feasible:
            feasible += 1
            assert decision.current_A == pytest.approx(float(lower_A), abs=1e-3)
            assert decision.active_constraint == str(active)
    assert feasible > 500


@pytest.mark.parametrize("name", NAMES)
def test_rest_after_any_safe_state_stays_below_the_stated_excess(name):
    preset, model = load_pair(name, None)
    surface = required_conditions(preset)[1]
    domain = certified_domain(preset, surface, chains(preset)[0])
    part = infeasible_part(domain, decided_conditions(firmware_constants(preset, model)))
    random = np.random.default_rng(2)
    limits, b = preset.limits, preset.uncertainty
    count = 300_000
    surface_K = limits.max_surface_temperature_K - random.exponential(0.5, count)
    core_gap, coolant_gap = random.uniform(-1, 9, count), random.uniform(-1, 20, count)
    inside = surface_K + core_gap <= limits.max_core_temperature_K
    inside &= domain.chain_value(surface_K, core_gap, coolant_gap) >= 0.0
    inside &= np.all([f.rate(core_gap, coolant_gap) <= f.largest for f in domain.flows], axis=0)
    state = np.array([surface_K + core_gap, surface_K, surface_K - coolant_gap])[:, inside]
    assert state.shape[1] > 500
    for excess in part.overshoots:
        gain, pushed = thermal_response(preset.cell, excess.time_s)
        later = (
            gain @ state
            + (pushed @ [b.core_K_per_s, b.surface_K_per_s, b.coolant_K_per_s])[:, None]
        )
        assert np.max(later[0]) - limits.max_core_temperature_K <= excess.core_K + 1e-9
        assert np.max(later[1]) - limits.max_surface_temperature_K <= excess.surface_K + 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_thermal_response_is_the_cells(name):
    cell = load_preset(name).cell
    state, pushed = CellState(0.5, 322.0, 318.0, 309.0), Disturbance(0.0, 4e-4, -3e-4, 2e-4)

    gain, rate_gain = thermal_response(cell, 5.0)

    simulated = state
    for _ in range(500):
        simulated = integrate_step(cell, simulated, 0.0, 0.0, 0.01, pushed)
    assert gain @ state[1:] + rate_gain @ pushed[1:] == pytest.approx(simulated[1:], abs=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_no_current_keeps_a_uniform_core_at_its_limit_and_rest_is_nearly_the_best(name):
    preset = load_preset(name)
    part, limit_K = corrected(name).fallback, preset.limits.max_core_temperature_K
    state = CellState(0.5, limit_K, limit_K, limit_K)
    pushed = Disturbance(0.0, preset.uncertainty.core_K_per_s, 0.0, 0.0)
    currents_A = np.linspace(preset.limits.reference_current_A, 0.0, 2301)

    rising = rates(preset.cell, state, currents_A, 0.0, pushed).core_temperature_K

    assert np.min(rising) > 0.0
    assert rising[-1] - np.min(rising) == pytest.approx(part.best_gain_K_per_s, abs=1e-8)
    assert currents_A[np.argmin(rising)] == pytest.approx(part.best_current_A, abs=0.01)
    assert 0.0 < part.uniform_excess_K <= part.overshoots[0].core_K


ENDS = st.floats(-1e3, 1e3)


@given(st.tuples(ENDS, ENDS), st.tuples(ENDS, ENDS), st.floats(0, 1), st.floats(0, 1))
def test_intervals_enclose(first, second, share, other_share):
    a, b = (Interval(np.float64(min(pair)), np.float64(max(pair))) for pair in (first, second))
    x = min(max(first), min(first) + share * (max(first) - min(first)))
    y = min(max(second), min(second) + other_share * (max(second) - min(second)))

    for enclosure, value in (
        (a + b, x + y),
        (a - b, x - y),
        (a * b, x * y),
        (2.0 - a, 2.0 - x),
        (a * -3.0, x * -3.0),
        (a.square(), x * x),
    ):
        assert enclosure.low <= value <= enclosure.high


@given(st.floats(-1, 1), st.floats(0, 5), st.floats(0.01, 1), st.floats(0, 0.2), st.floats(0.01, 1))
def test_held_integral_is_the_integral(least, fall, decay_per_s, begin_s, hold_s):
    expected, _ = quad(
        lambda s: np.exp(decay_per_s * s) * (least - fall * (begin_s + s)), 0.0, hold_s
    )

    found = held_integral(least, fall, decay_per_s, begin_s, begin_s + hold_s)

    assert found == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_a_longer_delay_is_covered_by_its_margins():
    preset, model = load_pair("lin2014", None)
    slower = replace(preset, timing=replace(preset.timing, delay_s=0.3))

    assert verify(slower, model).certified


def run_command(*arguments: str):
    app = Typer()
    app.command()(command)
    return CliRunner().invoke(app, list(arguments), standalone_mode=False)


def test_command_prints_the_certificate_as_json():
    result = run_command("--preset", "lin2014", "--json")

    content = json.loads(result.stdout)
    assert result.return_value == 0
    assert content["certified"] is True
    assert set(content["margins"]) == {
        "voltage_margin_V", "soc_margin_per_s", "core_margin_K_per_s", "surface_margin_K_per_s2",
    }  # fmt: skip
    assert content["barriers"]["core"]["domain"]["box"]["current_A"] == [-23.0, 0.0]


def test_command_fails_for_the_printed_formulas():
    result = run_command("--preset", "lin2014", "--formulas", "paper", "--boxes", "2000")

    words = " ".join(result.stdout.split())
    assert result.return_value == 1
    assert "NOT certified" in words
    assert "voltage: NOT certified: voltage_margin_V 0 is 0.0142 less than" in words
    assert "(at counted_soc 0.99, current_A -14.0356, soc_at_end 0.992026)" in words
    assert "take --formulas corrected; these formulas contain a9-resistance" in words
    (boxes,) = set(re.findall(r"undecided after (\d+) boxes", words))
    assert 2000 <= int(boxes) < 10_000
