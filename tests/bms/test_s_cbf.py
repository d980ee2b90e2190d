"""The S-CBF baseline against general solvers, stage by stage, and as a controller."""

from __future__ import annotations

import math

import numpy as np
import osqp
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from scipy.optimize import minimize

from bms.barrier import barrier_constants
from bms.baselines.s_cbf import SurfaceBarrierController, cascade, charging_current_A
from bms.cell import CellState, integrate_step
from bms.decision import ACTIVE_CONSTRAINTS, Observation
from bms.presets import load_preset, one_cell_preset_names

REFERENCE_A = -23.0
LIN2014 = SurfaceBarrierController(load_preset("lin2014"))
TOLD = Observation._fields[:6]


@pytest.fixture(params=one_cell_preset_names(), scope="module")
def preset(request):
    return load_preset(request.param)


def random_observations(seed, count):
    """States over and beyond the operating range, so that every constraint is active somewhere."""
    random = np.random.default_rng(seed)
    surface = random.uniform(300.0, 323.5, count)
    columns = (
        np.where(
            random.random(count) < 0.3, random.uniform(0.98, 1.0, count), random.random(count)
        ),
        surface + random.uniform(-1.0, 12.0, count),
        surface,
        surface - random.uniform(-1.0, 12.0, count),
        random.uniform(0.0, 1.0, count),
        np.full(count, REFERENCE_A),
    )
    return [Observation(*map(float, row)) for row in zip(*columns)]


def heat_limit_W(preset, observation):
    """Largest heat under the second-order surface barrier, written out from the cell model, E = 0.

    d2Ts/dt2 + alpha4 dTs/dt <= alpha3 (Ts_max - Ts), which is linear in the heat.
    """
    cell, gains = preset.cell, preset.gains
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    cinf = cell.coolant_heat_capacity_J_per_K
    _, tc, ts, tinf, cooling_W = observation[:5]
    surface_rate = (tc - ts) / (rc * cs) - (ts - tinf) / (rs * cs)
    coolant_rate = (ts - tinf) / (rs * cinf) - cooling_W / cinf

    def curvature(heat_W):
        core_rate = heat_W / cc - (tc - ts) / (rc * cc)
        return (core_rate - surface_rate) / (rc * cs) - (surface_rate - coolant_rate) / (rs * cs)

    def room(heat_W):
        return (
            gains.alpha3_per_s2 * (preset.limits.max_surface_temperature_K - ts)
            - gains.alpha4_per_s * surface_rate
            - curvature(heat_W)
        )

    return room(0.0) / (room(0.0) - room(1.0))


def nearest_by_osqp(wanted, lower, upper):
    """Value nearest to the wanted one in an interval, by the quadratic-programming solver."""
    solver = osqp.OSQP()
    solver.setup(
        P=sparse.csc_matrix([[2.0]]),
        q=np.array([-2.0 * wanted]),
        A=sparse.csc_matrix([[1.0]]),
        l=np.array([lower]),
        u=np.array([upper]),
        verbose=False,
        eps_abs=1e-9,
        eps_rel=1e-9,
        max_iter=100_000,
    )
    return float(solver.solve(raise_error=True).x[0])


def cascade_by_osqp(preset, observation):
    """Current of the cascade by two calls of the solver; None when a stage has no solution."""
    cell, limits = preset.cell, preset.limits
    resistance_ohm = cell.ohmic_resistance_ohm
    most_W = heat_limit_W(preset, observation)
    if most_W < 0.0:
        return None
    heat_W = nearest_by_osqp(resistance_ohm * REFERENCE_A**2, 0.0, most_W)
    lower_A = max(
        -math.sqrt(max(heat_W, 0.0) / resistance_ohm),
        (float(cell.ocv(observation.soc)) - limits.max_voltage_V) / resistance_ohm,
        -preset.gains.alpha1_per_s * (limits.max_soc - observation.soc) * cell.capacity_As,
    )
    return None if lower_A > 0.0 else nearest_by_osqp(REFERENCE_A, lower_A, 0.0)


def test_both_stages_agree_with_osqp_over_random_states(preset):
    controller = SurfaceBarrierController(preset)
    seen = set()
    for observation in random_observations(11, 1500):
        decision = controller.decide(observation)
        expected_A = cascade_by_osqp(preset, observation)
        assert decision.feasible is (expected_A is not None)
        assert decision.current_A == pytest.approx(expected_A or 0.0, abs=1e-4)
        seen.add(decision.active_constraint)
    of_families = {"map", "core_unknown"}
    assert seen == set(ACTIVE_CONSTRAINTS) - {"core", "invalid"} - of_families


def test_the_thermal_stage_agrees_with_slsqp(preset):
    cell = preset.cell
    constants = barrier_constants(cell, preset)
    wanted_W = cell.ohmic_resistance_ohm * REFERENCE_A**2
    for observation in random_observations(12, 60):
        most_W = heat_limit_W(preset, observation)
        if most_W < 0.0:
            continue
        solution = minimize(
            lambda q: (q[0] - wanted_W) ** 2,
            [0.0],
            jac=lambda q: np.array([2.0 * (q[0] - wanted_W)]),
            method="SLSQP",
            bounds=[(0.0, None)],
            constraints=[{"type": "ineq", "fun": lambda q, most_W=most_W: most_W - q[0]}],
            options={"ftol": 1e-14},
        )
        stages = cascade(
            cell, preset, constants, CellState(*observation[:4]), observation[4], REFERENCE_A
        )
        assert float(stages.heat_W) == pytest.approx(solution.x[0], abs=1e-6)


def test_many_states_at_once_give_what_each_gives_alone(preset):
    observations = random_observations(13, 200)
    columns = [np.array(column) for column in zip(*observations)][:5]
    stages = cascade(
        preset.cell,
        preset,
        barrier_constants(preset.cell, preset),
        CellState(*columns[:4]),
        columns[4],
        REFERENCE_A,
    )
    controller = SurfaceBarrierController(preset)
    alone_A = [controller.decide(observation).current_A for observation in observations]
    assert charging_current_A(stages, REFERENCE_A).tolist() == pytest.approx(alone_A, abs=1e-12)


def test_the_active_constraint_is_the_one_without_slack(preset):
    controller = SurfaceBarrierController(preset)
    for observation in random_observations(14, 300):
        decision = controller.decide(observation)
        margins = decision.margins
        assert margins.core_K_per_s == math.inf
        if not decision.feasible:
            assert (decision.current_A, decision.active_constraint) == (0.0, "infeasible")
            assert decision.lower_A > decision.upper_A
            continue
        slack = {
            "voltage": margins.voltage_V,
            "soc": margins.soc_per_s,
            "surface": margins.surface_K_per_s2,
        }
        assert min(slack.values()) >= -1e-9
        assert decision.lower_A <= decision.current_A <= decision.upper_A
        if decision.active_constraint == "none":
            assert decision.current_A == REFERENCE_A
        else:
            assert slack[decision.active_constraint] == pytest.approx(0.0, abs=1e-9)


@given(reference_A=st.floats(-60.0, 60.0))
def test_the_reference_is_never_exceeded_and_never_discharges(reference_A):
    cool = Observation(0.4, 300.0, 299.0, 298.0, 1.0, reference_A)
    decision = LIN2014.decide(cool)
    assert decision.current_A == pytest.approx(min(max(reference_A, REFERENCE_A), 0.0), abs=1e-9)
    assert decision.feasible


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", TOLD)
def test_input_that_is_not_finite_gives_no_current(field, wrong):
    cool = Observation(0.4, 300.0, 299.0, 298.0, 1.0, REFERENCE_A)
    decision = LIN2014.decide(cool._replace(**{field: wrong}))
    assert (decision.current_A, decision.feasible) == (0.0, False)
    assert decision.active_constraint == "invalid"


def test_the_core_gets_hotter_than_its_limit_and_the_surface_passes_by_reversible_heat():
    """What the paper shows the baseline for: 10C from the calibrated start."""
    preset = load_preset("paper_calibrated")
    controller, start = SurfaceBarrierController(preset), preset.initial
    period_s, limits = preset.timing.sampling_period_s, preset.limits
    state = CellState(start.soc, *[start.temperature_K] * 3)
    core_peak_K = surface_peak_K = 0.0
    while state.soc < limits.completion_soc:
        decision = controller.decide(
            Observation(*state, start.cooling_power_W, limits.reference_current_A)
        )
        state = integrate_step(
            preset.cell, state, decision.current_A, start.cooling_power_W, period_s
        )
        core_peak_K = max(core_peak_K, state.core_temperature_K)
        surface_peak_K = max(surface_peak_K, state.surface_temperature_K)
    assert core_peak_K > limits.max_core_temperature_K + 4.0
    assert (
        limits.max_surface_temperature_K < surface_peak_K < limits.max_surface_temperature_K + 0.5
    )
