"""The baselines as controllers: each from an oracle that knows nothing of its formulas."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.baselines import (
    BASELINES,
    CcCvController,
    MultiStageController,
    SingleStepSurfaceBarrierController,
    SurfaceBarrierController,
)
from bms.baselines.cc_cv import CutBack
from bms.baselines.multi_stage import STAGES
from bms.cell import CellState, rates, terminal_voltage_V
from bms.decision import Observation
from bms.presets import load_preset, one_cell_preset_names

PRESETS = {name: load_preset(name) for name in one_cell_preset_names()}
PRESET = PRESETS["paper_calibrated"]
LIMITS = PRESET.limits
FULL_A = LIMITS.reference_current_A
GRID_A = np.linspace(FULL_A, 0.0, 2301)
GRID_STEP_A = GRID_A[1] - GRID_A[0]
ROUNDING_A = 1e-9

states = st.tuples(
    st.floats(0.0, 0.99), st.floats(290.0, 330.0), st.floats(285.0, 325.0), st.floats(280.0, 320.0)
).map(lambda values: CellState(*values))
cooling_W = st.floats(0.0, 3.0)
presets = st.sampled_from(list(PRESETS.values()))


def without_reversible_heat(preset):
    cell = dataclasses.replace(preset.cell, entropic_coefficient_V_per_K=0.0)
    return dataclasses.replace(preset, cell=cell)


def observation(state, cooling_power_W=1.0, reference_current_A=FULL_A):
    return Observation(*state, cooling_power_W, reference_current_A)


def measured(soc=0.2, surface_K=300.0, voltage_V=3.2, current_A=0.0, wanted_A=FULL_A, core_K=None):
    """What a charger without a thermal model is told."""
    core_K = math.nan if core_K is None else core_K
    return Observation(soc, core_K, surface_K, 300.0, 1.0, wanted_A, voltage_V, current_A)


def best_on_a_grid_A(preset, state, cooling_power_W):
    """Strongest current at which all three barriers may go on, by the model's own derivatives."""
    cell, limits, gains = preset.cell, preset.limits, preset.gains
    rate = rates(cell, state, GRID_A, cooling_power_W)
    dt_s = 1e-3
    ahead = CellState(*(x + dt_s * dx for x, dx in zip(state, rate)))
    rate_ahead = rates(cell, ahead, GRID_A, cooling_power_W)
    second = (rate_ahead.surface_temperature_K - rate.surface_temperature_K) / dt_s
    barrier_K = limits.max_surface_temperature_K - state.surface_temperature_K
    surface = (
        -second - gains.alpha4_per_s * rate.surface_temperature_K + gains.alpha3_per_s2 * barrier_K
    )
    soc = gains.alpha1_per_s * (limits.max_soc - state.soc) - rate.soc
    voltage_V = limits.max_voltage_V - terminal_voltage_V(cell, state.soc, GRID_A)
    allowed = GRID_A[(surface >= 0.0) & (soc >= 0.0) & (voltage_V >= 0.0)]
    return allowed.min() if allowed.size else None


@given(presets, states, cooling_W)
def test_single_step_is_the_strongest_current_that_keeps_the_three_barriers(
    preset, state, cooling_power_W
):
    best_A = best_on_a_grid_A(preset, state, cooling_power_W)
    decision = SingleStepSurfaceBarrierController(preset).decide(
        observation(state, cooling_power_W)
    )
    if best_A is None:
        assert decision.current_A >= -GRID_STEP_A
    else:
        assert decision.current_A == pytest.approx(best_A, abs=2 * GRID_STEP_A)


@given(presets, states, cooling_W)
def test_the_cascade_is_that_too_for_a_cell_without_reversible_heat(preset, state, cooling_power_W):
    """So the two forms differ by the reversible heat and by nothing else."""
    preset = without_reversible_heat(preset)
    told = observation(state, cooling_power_W)
    cascade = SurfaceBarrierController(preset).decide(told)
    single = SingleStepSurfaceBarrierController(preset).decide(told)
    assert single.current_A == pytest.approx(cascade.current_A, abs=1e-6)
    assert single.feasible == cascade.feasible
    assert single.margins == pytest.approx(cascade.margins, abs=1e-9)


@given(states, cooling_W)
def test_heat_that_the_cascade_neglects_makes_it_charge_harder(state, cooling_power_W):
    assert PRESET.cell.entropic_coefficient_V_per_K > 0.0, "charging heats this cell"
    told = observation(state, cooling_power_W)
    cascade_A = SurfaceBarrierController(PRESET).decide(told).current_A
    single_A = SingleStepSurfaceBarrierController(PRESET).decide(told).current_A
    assert cascade_A <= single_A + ROUNDING_A


@pytest.mark.parametrize("position", range(6))
@pytest.mark.parametrize(
    "controller", [SurfaceBarrierController, SingleStepSurfaceBarrierController]
)
def test_a_barrier_baseline_without_the_true_state_does_not_charge(controller, position):
    told = list(observation(CellState(0.2, 300.0, 300.0, 300.0)))
    told[position] = math.nan
    decision = controller(PRESET).decide(Observation(*told))
    assert (decision.current_A, decision.active_constraint) == (0.0, "invalid")


@pytest.mark.parametrize("field", ["soc", "surface_temperature_K", "voltage_V", "current_A"])
@pytest.mark.parametrize("controller", [CcCvController, MultiStageController])
def test_a_measuring_charger_without_a_measurement_does_not_charge(controller, field):
    decision = controller(PRESET).decide(measured()._replace(**{field: math.nan}))
    assert (decision.current_A, decision.active_constraint) == (0.0, "invalid")


@pytest.mark.parametrize("controller", [CcCvController, MultiStageController])
def test_a_measuring_charger_does_not_look_at_the_core(controller):
    unknown, boiling = (controller(PRESET).decide(measured(core_K=K)) for K in (None, 400.0))
    assert unknown == boiling
    assert unknown.current_A == FULL_A


@given(st.floats(2.5, 4.0), st.floats(-25.0, 0.0), st.floats(270.0, 340.0), st.floats(-40.0, 0.0))
def test_every_charger_stays_between_reference_and_nothing(voltage_V, current_A, surface_K, wanted):
    told = measured(voltage_V=voltage_V, current_A=current_A, surface_K=surface_K, wanted_A=wanted)
    for controller in (CcCvController(PRESET), MultiStageController(PRESET)):
        assert max(FULL_A, wanted) <= controller.decide(told).current_A <= 0.0


def test_cc_cv_charges_at_constant_current_while_cool_and_low():
    decision = CcCvController(PRESET).decide(measured())
    assert (decision.current_A, decision.active_constraint) == (FULL_A, "none")


@given(st.floats(3.32, 3.58), st.floats(-23.0, 0.0))
def test_cc_cv_holds_its_voltage_from_whatever_current_flowed(open_circuit_V, flowed_A):
    resistance_ohm = PRESET.cell.ohmic_resistance_ohm
    told = measured(
        voltage_V=open_circuit_V - flowed_A * resistance_ohm, current_A=flowed_A, soc=0.9
    )
    decision = CcCvController(PRESET).decide(told)
    voltage_V = open_circuit_V - decision.current_A * resistance_ohm
    held_V = LIMITS.max_voltage_V - PRESET.sensors.voltage_V.error_bound
    assert decision.active_constraint == "voltage"
    assert voltage_V == pytest.approx(held_V, abs=1e-9)


def test_cc_cv_does_not_discharge_a_cell_above_its_voltage():
    assert CcCvController(PRESET).decide(measured(voltage_V=3.7)).current_A == 0.0


@pytest.mark.parametrize(
    ("surface_K", "share"),
    [(300.0, 1.0), (318.0, 1.0), (319.0, 0.8), (320.5, 0.5), (323.0, 0.0), (330.0, 0.0)],
)
def test_cc_cv_is_cut_back_linearly_over_the_last_five_kelvin(surface_K, share):
    assert LIMITS.max_surface_temperature_K == 323.0
    decision = CcCvController(PRESET).decide(measured(surface_K=surface_K))
    assert decision.current_A == pytest.approx(share * FULL_A)
    assert decision.active_constraint == ("none" if share == 1.0 else "surface")


@pytest.mark.parametrize(
    ("below_V", "beyond_tail_A", "is_full"),
    [(0.0, -0.001, True), (0.0, 0.001, False), (0.0049, -0.001, True), (0.0051, -0.001, False)],
)
def test_cc_cv_is_full_at_its_voltage_with_no_more_than_a_twentieth_of_the_capacity(
    below_V, beyond_tail_A, is_full
):
    highest_V = LIMITS.max_voltage_V - PRESET.sensors.voltage_V.error_bound
    current_A = -(PRESET.cell.capacity_Ah / 20.0 + beyond_tail_A)
    told = measured(voltage_V=highest_V - below_V, current_A=current_A)
    assert CcCvController(PRESET).is_full(told) is is_full
    assert not CcCvController(PRESET).is_full(measured(voltage_V=math.nan, current_A=0.0))


def test_the_cut_back_can_be_set():
    charger = CcCvController(PRESET, CutBack(begin_K=300.0, end_K=310.0))
    assert charger.decide(measured(surface_K=307.5)).current_A == pytest.approx(0.25 * FULL_A)


@pytest.mark.parametrize("number", range(len(STAGES)))
def test_a_stage_ends_at_its_state_of_charge(number):
    before, after = (
        MultiStageController(PRESET).decide(measured(soc=STAGES[number].end_soc + step))
        for step in (-1e-6, 0.0)
    )
    following = [*(stage.current_share for stage in STAGES), 0.0][number + 1]
    assert before.current_A == pytest.approx(STAGES[number].current_share * FULL_A)
    assert after.current_A == pytest.approx(following * FULL_A)
    assert after.active_constraint == "soc"


@pytest.mark.parametrize(
    ("surface_K", "share"), [(312.9, 1.0), (313.0, 0.8), (318.5, 0.4), (322.9, 0.2), (323.0, 0.0)]
)
def test_a_warm_surface_ends_as_many_stages_as_it_has_to(surface_K, share):
    decision = MultiStageController(PRESET).decide(measured(surface_K=surface_K))
    assert decision.current_A == pytest.approx(share * FULL_A)


def test_the_charging_voltage_at_its_own_current_ends_a_stage():
    """At 3.35 V open circuit 23 A would give 3.639 V and 18.4 A gives 3.581 V."""
    decision = MultiStageController(PRESET).decide(measured(voltage_V=3.35))
    assert decision.current_A == pytest.approx(0.8 * FULL_A)
    assert decision.active_constraint == "voltage"


@settings(max_examples=50)
@given(
    st.lists(
        st.tuples(st.floats(0.0, 1.0), st.floats(290.0, 325.0), st.floats(2.8, 3.7)),
        min_size=2,
        max_size=20,
    )
)
def test_stages_never_go_back(history):
    charger = MultiStageController(PRESET)
    currents_A = [
        charger.decide(measured(soc=soc, surface_K=surface_K, voltage_V=voltage_V)).current_A
        for soc, surface_K, voltage_V in history
    ]
    assert currents_A == sorted(currents_A)


def test_the_registry_makes_what_it_names():
    assert len(BASELINES) == 4
    for name, baseline in BASELINES.items():
        assert baseline.make(PRESET).name == name
