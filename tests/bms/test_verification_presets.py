"""`bms verify` for presets that do not ship: certified, or told why and what to change."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.barrier.readings import reading_errors
from bms.cell import CellState, Disturbance, integrate_step, rates
from bms.errors import InputError
from bms.model.pair import load_pair
from bms.presets import load_preset, one_cell_preset_names
from bms.presets.paper_form import in_paper_form
from bms.verification import SLIPS, verify
from bms.verification.boxes import Boxes
from bms.verification.conditions import chains, firmware_constants, required_conditions
from bms.verification.domain import certified_domain
from bms.verification.drift import drift_gain_s, held_rates
from bms.verification.thermal import certify
from bms.verification.verify import thermal_cases
from tests.bms.plausible_presets import model_for, other_cells, plausible_presets

OTHERS = other_cells()
FEW_SAMPLES, FEW_BOXES, FEW_OWN_BOXES = 20_000, 40_000, 2_000
ERROR_BOUNDS_K = st.floats(0.05, 1.5)
FORMS = {"its own": lambda preset: preset, "the paper's": in_paper_form}
"""Gains and surface condition of a shipped preset."""


def with_limits(preset, **limits):
    return replace(preset, limits=replace(preset.limits, **limits))


def with_timing(preset, sampling_period_s, delay_s):
    timing = replace(preset.timing, sampling_period_s=sampling_period_s, delay_s=delay_s)
    return replace(preset, timing=timing)


@pytest.mark.parametrize("name", OTHERS)
def test_other_cells_are_certified_and_charge(name):
    result = verify(OTHERS[name], model_for(OTHERS[name]), samples=FEW_SAMPLES)

    assert result.certified
    assert result.refusals == {} and result.obstacles == ()


@settings(max_examples=10)
@given(plausible_presets(), ERROR_BOUNDS_K)
def test_any_plausible_preset_is_certified_in_temperature(preset, error_bound_K):
    """Less search than the command makes: a box is tried by its own drift for a while only."""
    constants = firmware_constants(preset, model_for(preset, error_bound_K))
    for domain, case in thermal_cases(preset, constants):
        found = certify(domain, case, reading_errors(preset), FEW_BOXES, FEW_OWN_BOXES)
        assert found.holds, found


@pytest.mark.slow
@settings(max_examples=60)
@given(plausible_presets(), ERROR_BOUNDS_K)
def test_any_plausible_preset_is_certified_by_the_whole_command(preset, error_bound_K):
    result = verify(preset, model_for(preset, error_bound_K), samples=FEW_SAMPLES)

    assert result.certified, result.refusals
    for obstacle in result.obstacles:
        assert obstacle.reason and obstacle.state and obstacle.change


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("held", [(0.5, 1.0), (1.0, 2.0)])
def test_a_hold_as_long_as_the_fast_mode_is_certified_by_histories_from_rest(held, form):
    # No steeper ramp is taken at so long a period.
    preset = with_limits(FORMS[form](load_preset("paper_calibrated")), current_growth_A_per_s=1.0)
    preset = with_timing(preset, *held)
    cell = preset.cell
    into_surface_W_per_K = 1 / cell.core_resistance_K_per_W + 1 / cell.surface_resistance_K_per_W
    assert sum(held) > cell.surface_heat_capacity_J_per_K / into_surface_W_per_K
    model = model_for(preset, shipped="paper_calibrated")

    result = verify(preset, model, samples=FEW_SAMPLES)

    assert result.certified
    assert any(b.certificate.by_history for b in result.barriers)


@pytest.mark.parametrize("name", one_cell_preset_names())
@pytest.mark.parametrize("held", [(0.1, 0.1), (1.0, 2.0)])
def test_no_history_of_inputs_leaves_the_enclosed_rates_within_the_hold(name, held):
    preset = with_timing(load_preset(name), *held)
    domain = certified_domain(preset, required_conditions(preset)[0], chains(preset)[0])
    random, b = np.random.default_rng(4), preset.uncertainty
    count, steps = 2000, 30
    core_gap, coolant_gap = random.uniform(-1.0, 9.0, count), random.uniform(-1.0, 16.0, count)
    surface_K, cooling_W = np.full(count, 310.0), random.uniform(0.0, domain.high.cooling_W, count)
    corners = np.stack([surface_K, core_gap, coolant_gap, np.zeros(count), cooling_W], axis=1)
    enclosed = held_rates(domain, drift_gain_s(domain), Boxes(corners, corners))
    state = CellState(np.full(count, 0.5), surface_K + core_gap, surface_K, surface_K - coolant_gap)
    bounds = np.array([0.0, b.core_K_per_s, b.surface_K_per_s, b.coolant_K_per_s])
    slack = 1e-9
    for _ in range(steps):
        current_A = random.choice([domain.low.current_A, 0.0], count)
        disturbance = Disturbance(*(random.choice([-1.0, 1.0], (4, count)).T * bounds).T)
        for moved, enclosure in zip(
            rates(preset.cell, state, current_A, cooling_W, disturbance)[1:], enclosed
        ):
            assert np.all(moved >= enclosure.low - slack) and np.all(
                moved <= enclosure.high + slack
            )
        state = integrate_step(
            preset.cell, state, current_A, cooling_W, domain.held_s / steps, disturbance
        )


@pytest.mark.parametrize(
    ("form", "hardest"), [("its own", "surface, psi = B4' + 0.16 B4"), ("the paper's", "core")]
)
def test_a_search_that_ends_too_early_says_how_many_boxes_to_give(form, hardest):
    preset, model = load_pair("lin2014", None)
    pair = FORMS[form](preset), model

    result = verify(*pair, largest_boxes=500, samples=FEW_SAMPLES)

    assert not result.certified and list(result.refusals) == [hardest]
    refusal = result.refusals[hardest]
    assert re.fullmatch(r"undecided after \d+ boxes", refusal.reason)
    assert set(refusal.state) == {
        "surface_K", "core_gap_K", "coolant_gap_K", "current_A", "cooling_W",
    }  # fmt: skip
    (boxes,) = re.fullmatch(r"give --boxes (\d+)", refusal.change).groups()
    assert verify(*pair, largest_boxes=int(boxes), samples=FEW_SAMPLES).certified


@pytest.mark.parametrize("max_voltage_V", [3.35, 3.45])
def test_a_voltage_limit_below_completion_says_which_limit_would_do(max_voltage_V):
    preset = with_limits(load_preset("lin2014"), max_voltage_V=max_voltage_V)

    result = verify(preset, model_for(preset), samples=FEW_SAMPLES)

    (obstacle,) = result.obstacles
    assert result.certified
    assert "completion_soc 0.99 is not reached" in obstacle.reason
    assert 0.0 < obstacle.state["counted_soc"] < 0.99
    higher, lower = re.fullmatch(
        r"raise limits\.max_voltage_V to (\S+) or lower limits\.completion_soc to (\S+)",
        obstacle.change,
    ).groups()
    for mended in (
        with_limits(preset, max_voltage_V=float(higher)),
        with_limits(preset, completion_soc=float(lower)),
    ):
        again = verify(mended, model_for(mended), samples=FEW_SAMPLES)
        assert again.certified and again.obstacles == ()
    assert float(higher) < 3.5, "more than is needed"


def test_completion_at_the_limit_of_charge_says_how_much_less_would_do():
    preset = with_limits(load_preset("lin2014"), completion_soc=1.0, max_voltage_V=3.8)

    result = verify(preset, model_for(preset), samples=FEW_SAMPLES)

    (obstacle,) = result.obstacles
    assert result.certified
    (lower,) = re.fullmatch(r"lower limits\.completion_soc to (\S+)", obstacle.change).groups()
    mended = with_limits(preset, completion_soc=float(lower))
    assert verify(mended, model_for(mended), samples=FEW_SAMPLES).obstacles == ()
    assert float(lower) > 0.99, "less than is needed"


@pytest.mark.parametrize(("form", "start_K"), [("its own", 322.9), ("the paper's", 322.0)])
def test_a_start_too_near_the_temperature_limit_says_which_start_would_do(form, start_K):
    preset = FORMS[form](load_preset("lin2014"))

    def from_start(temperature_K):
        started = replace(preset, initial=replace(preset.initial, temperature_K=temperature_K))
        return verify(started, model_for(started), samples=FEW_SAMPLES)

    result = from_start(start_K)

    (obstacle,) = result.obstacles
    assert result.certified
    (lower,) = re.fullmatch(
        r"start at an initial\.temperature_K of (\S+) or less", obstacle.change
    ).groups()
    assert from_start(float(lower)).obstacles == ()
    (still,) = from_start(float(lower) + 0.1).obstacles
    assert still.change == obstacle.change, "colder than is needed"


@pytest.mark.parametrize("limit", ["max_core_temperature_K", "max_surface_temperature_K"])
def test_a_limit_below_the_operating_box_is_refused_by_name(limit):
    preset = with_limits(load_preset("lin2014"), **{limit: 280.0})

    with pytest.raises(
        InputError, match=f"box.surface_temperature_K begins at 283.*limits.{limit}"
    ):
        verify(preset, model_for(preset), SLIPS)
