"""The closed-form decision of the firmware against independent solvers, and its refusals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np
import osqp
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse
from scipy.optimize import brentq, minimize

from bms.barrier.rounding import CONSTANT_ROUNDINGS, UNIT, rounding_allowances
from bms.decision import Decision
from bms.firmware import Firmware
from bms.presets import load_preset
from bms.presets.paper_form import in_paper_form
from tests.firmware.constraints import NAMES, interval, quadratics, value

PRESETS = ("lin2014", "paper_calibrated")
STATES = 10_000
TOLERANCE_A = 1e-3
INPUTS = ("soc", "core_temperature_K", "surface_temperature_K", "coolant_temperature_K")


@cache
def lin2014() -> Firmware:
    return Firmware("lin2014")


@pytest.fixture(scope="module", params=PRESETS)
def firmware(request: pytest.FixtureRequest) -> Firmware:
    return Firmware(request.param)


@pytest.fixture(scope="module", params=PRESETS)
def paper_firmware(request: pytest.FixtureRequest) -> Firmware:
    """With the paper's gains, by which each of the four constraints decides often."""
    return Firmware(in_paper_form(load_preset(request.param)))


def random_states(seed: int, count: int) -> list[dict[str, float]]:
    """States over and beyond the operating range: limits are reached from all sides."""
    random = np.random.default_rng(seed)
    surface = random.uniform(280, 325, count)
    columns = {
        "soc": random.uniform(0, 1, count),
        "core_temperature_K": surface + random.uniform(-3, 12, count),
        "surface_temperature_K": surface,
        "coolant_temperature_K": surface - random.uniform(-2, 40, count),
        "cooling_power_W": random.uniform(0, 3, count),
        "reference_current_A": random.choice([-23.0, -11.5, -2.3], count),
    }
    return [dict(zip(columns, row)) for row in zip(*(map(float, c) for c in columns.values()))]


def solve(firmware: Firmware, state: dict[str, float]) -> Decision:
    return firmware.solve(**state)


@pytest.mark.slow
def test_decision_equals_osqp_on_the_interval_form(firmware: Firmware) -> None:
    solver = osqp.OSQP()
    one = sparse.csc_matrix([[1.0]])
    solver.setup(
        one, np.zeros(1), one, np.array([-1.0]), np.array([0.0]),
        verbose=False, eps_abs=1e-9, eps_rel=1e-9, max_iter=20_000,
    )  # fmt: skip
    feasible = 0
    for state in random_states(1, STATES):
        lower, upper = interval(
            quadratics(firmware.parameters, state), state["reference_current_A"]
        )
        if lower > upper - 1e-4:
            continue
        feasible += 1
        solver.update(
            q=np.array([-state["reference_current_A"]]), l=np.array([lower]), u=np.array([upper])
        )
        expected = float(solver.solve(raise_error=True).x[0])
        decision = solve(firmware, state)
        assert decision.feasible, state
        assert decision.current_A == pytest.approx(expected, abs=TOLERANCE_A), state
    assert feasible > STATES / 4


@pytest.mark.slow
def test_decision_equals_slsqp_on_the_raw_constraints(firmware: Firmware) -> None:
    checked = 0
    for state in random_states(2, STATES):
        reference = state["reference_current_A"]
        groups = quadratics(firmware.parameters, state)
        lower, upper = interval(groups, reference)
        if lower > upper - 1e-4:
            continue
        rows = np.array([q for group in groups for q in group])
        rows /= np.abs(rows[:, 1:]).sum(axis=1, keepdims=True)
        start = 0.5 * (lower + upper)
        answer = minimize(
            lambda u, r=reference: (u[0] - r) ** 2,
            [start],
            jac=lambda u, r=reference: [2 * (u[0] - r)],
            method="SLSQP",
            bounds=[(reference, 0.0)],
            constraints={
                "type": "ineq",
                "fun": lambda u, m=rows: m @ [1.0, u[0], u[0] ** 2],
                "jac": lambda u, m=rows: (m @ [0.0, 1.0, 2 * u[0]])[:, None],
            },
            options={"ftol": 1e-12, "maxiter": 200},
        )
        checked += 1
        assert solve(firmware, state).current_A == pytest.approx(answer.x[0], abs=TOLERANCE_A), (
            state
        )
    assert checked > STATES / 4


def test_a_temperature_counts_with_more_digits_than_float32_has(paper_firmware: Firmware) -> None:
    """Where the current depends much on them, rounded ones would cost or give milliamperes."""
    lost_A = 0.0
    for state in random_states(8, 6_000):
        reference_A = state["reference_current_A"]
        lower_A, upper_A = interval(quadratics(paper_firmware.parameters, state), reference_A)
        if lower_A > upper_A - 1e-4:
            continue
        assert solve(paper_firmware, state).current_A == pytest.approx(lower_A, abs=2e-4), state
        rounded = {
            name: float(np.float32(given)) if name.endswith("_K") else given
            for name, given in state.items()
        }
        of_rounded = interval(quadratics(paper_firmware.parameters, rounded), reference_A)
        lost_A = max(lost_A, abs(of_rounded[0] - lower_A))
    assert lost_A > 1e-3


def test_infeasible_states_give_zero_and_say_so(firmware: Firmware) -> None:
    infeasible = 0
    for state in random_states(3, STATES):
        lower, upper = interval(
            quadratics(firmware.parameters, state), state["reference_current_A"]
        )
        if lower <= upper + 1e-4:
            continue
        infeasible += 1
        decision = solve(firmware, state)
        assert (decision.current_A, decision.feasible) == (0.0, False), state
        assert decision.active_constraint == "infeasible"
    assert infeasible > 100


def test_decision_names_the_constraint_that_decides_and_reports_all_margins(
    firmware: Firmware,
) -> None:
    seen = set()
    for state in random_states(4, 2_000):
        decision = solve(firmware, state)
        groups = quadratics(firmware.parameters, state)
        margins = [min(value(q, decision.current_A) for q in group) for group in groups]
        for mine, expected, scale in zip(decision.margins, margins, (4.0, 0.05, 1.0, 2.0)):
            assert mine == pytest.approx(expected, abs=1e-5 * scale)
        seen.add(decision.active_constraint)
        if not decision.feasible:
            continue
        assert decision.lower_A == decision.current_A
        if decision.active_constraint == "none":
            assert decision.current_A == pytest.approx(state["reference_current_A"])
        else:
            assert margins[NAMES.index(decision.active_constraint)] == pytest.approx(0, abs=1e-5)
    assert {"none", "soc", "core", "infeasible"} <= seen


def test_a_constraint_that_only_just_decides_decides_the_same(paper_firmware: Firmware) -> None:
    """Where it ends does not depend on the reference, however little that lies beyond."""
    decided = {"core": 0, "surface": 0}
    for state in random_states(7, 3_000):
        decision = solve(paper_firmware, state)
        if decision.active_constraint not in decided or decision.current_A == 0.0:
            continue
        decided[decision.active_constraint] += 1
        for steps in (1, 2, 5, 20, 100, 500, 5_000):
            # Single steps of float32 beyond the end.
            reference_A = np.float32(decision.current_A) * np.float32(1.0 + steps * 2.0**-23)
            closer = solve(paper_firmware, {**state, "reference_current_A": float(reference_A)})
            assert closer.current_A == decision.current_A, (state, steps)
    assert sum(decided.values()) > 100


def tight_states(firmware: Firmware, name: str, count: int) -> Iterator[dict[str, float]]:
    """States in which a constraint leaves a few ampere or none at all, where its slope is least."""
    random = np.random.default_rng(5)
    group = NAMES.index(name)
    for _ in range(count):
        current_A = random.uniform(-3.0, 0.3)
        core_above_K, coolant_below_K = random.uniform(0, 8), random.uniform(-2, 35)
        cooling_W = random.uniform(0, 1)

        def state(surface_K: float) -> dict[str, float]:
            return {
                "soc": 0.3,
                "core_temperature_K": surface_K + core_above_K,  # noqa: B023
                "surface_temperature_K": surface_K,
                "coolant_temperature_K": surface_K - coolant_below_K,  # noqa: B023
                "cooling_power_W": float(np.float32(cooling_W)),  # noqa: B023
                "reference_current_A": -23.0,
            }

        def left_K(surface_K: float) -> float:
            sides = quadratics(firmware.parameters, state(surface_K))[group]
            return min(value(q, current_A) for q in sides)  # noqa: B023

        low_K, high_K = 285.0, 324.0
        if left_K(low_K) > 0.0 > left_K(high_K):
            yield state(brentq(left_K, low_K, high_K, xtol=1e-9))


@pytest.mark.parametrize("name", ["core", "surface"])
def test_float32_never_takes_more_than_its_allowance(paper_firmware: Firmware, name: str) -> None:
    allowances = rounding_allowances(paper_firmware.preset.cell, paper_firmware.preset)
    decided = 0
    for state in tight_states(paper_firmware, name, 1_500):
        decision = solve(paper_firmware, state)
        if decision.current_A == 0.0:
            continue
        decided += decision.active_constraint == name
        groups = quadratics(paper_firmware.parameters, state)
        for other in ("core", "surface"):
            sides, allowance = groups[NAMES.index(other)], allowances[NAMES.index(other)]
            assert min(value(q, decision.current_A) for q in sides) >= -allowance, state
    assert decided > 50


@pytest.mark.parametrize("name", ["voltage", "soc"])
def test_float32_never_takes_more_than_its_electrical_allowance(
    paper_firmware: Firmware, name: str
) -> None:
    preset = paper_firmware.preset
    group, ocv = NAMES.index(name), preset.cell.ocv
    allowance = rounding_allowances(preset.cell, preset)[group]
    if name == "voltage":
        # The counting error of the margin has room for the rounding of the table's own points.
        steepest_V = np.max(np.diff(ocv.voltage_V) / np.diff(ocv.soc))
        allowance += CONSTANT_ROUNDINGS * UNIT * steepest_V
    random = np.random.default_rng(6)
    decided = 0
    for soc in random.uniform(0.8, preset.limits.max_soc, 3_000).astype(np.float32):
        state = {**COLD, "soc": float(soc)}
        decision = solve(paper_firmware, state)
        if decision.active_constraint != name:
            continue
        decided += 1
        (side,) = quadratics(paper_firmware.parameters, state)[group]
        assert abs(value(side, decision.current_A)) <= allowance, state
    assert decided > 300


COLD = {
    "core_temperature_K": 290.0,
    "surface_temperature_K": 290.0,
    "coolant_temperature_K": 290.0,
    "cooling_power_W": 0.5,
    "reference_current_A": -23.0,
}
BAD = st.sampled_from([math.nan, math.inf, -math.inf, 1e30, -1e30])
GOOD = {
    "soc": 0.5,
    "core_temperature_K": 300.0,
    "surface_temperature_K": 299.0,
    "coolant_temperature_K": 298.0,
    "cooling_power_W": 0.5,
    "reference_current_A": -23.0,
}


@given(name=st.sampled_from(sorted(GOOD)), bad=BAD)
def test_an_input_that_is_no_number_or_unphysical_gives_zero(name: str, bad: float) -> None:
    decision = lin2014().solve(**{**GOOD, name: bad})
    assert (decision.current_A, decision.feasible) == (0.0, False)
    assert decision.active_constraint == "invalid"


def test_a_discharging_reference_is_refused() -> None:
    decision = lin2014().solve(**{**GOOD, "reference_current_A": 0.01})
    assert (decision.current_A, decision.active_constraint) == (0.0, "invalid")


@given(
    temperature=st.floats(250, 340),
    rise=st.floats(0, 5),
    soc=st.floats(0, 1),
)
def test_a_hotter_cell_is_never_charged_harder(temperature: float, rise: float, soc: float) -> None:
    """Raising all temperatures leaves the differences and eats the distance to the limits."""
    firmware = lin2014()

    def current_at(shift: float) -> float:
        return firmware.solve(
            soc=soc,
            core_temperature_K=temperature + shift + 2.0,
            surface_temperature_K=temperature + shift,
            coolant_temperature_K=temperature + shift - 2.0,
            cooling_power_W=0.5,
            reference_current_A=-23.0,
        ).current_A

    assert current_at(rise) >= current_at(0.0) - 1e-4


@pytest.mark.parametrize("preset", PRESETS)
def test_parameters_have_all_stable_keys(preset: str) -> None:
    keys = """core_resistance_K_per_W core_heat_capacity_J_per_K surface_resistance_K_per_W
        surface_heat_capacity_J_per_K coolant_heat_capacity_J_per_K ohmic_resistance_ohm
        entropic_coefficient_V_per_K capacity_Ah ocv_soc ocv_V max_voltage_V max_soc
        max_core_temperature_K max_surface_temperature_K alpha1 alpha2 alpha3 alpha4
        soc_uncertainty_per_s core_uncertainty_K_per_s surface_uncertainty_K_per_s
        coolant_uncertainty_K_per_s surface_uncertainty_rate_K_per_s2 estimation_error_bound_K
        sampling_period_s voltage_margin_V soc_margin_per_s core_margin_K_per_s
        surface_margin_K_per_s2""".split()
    assert set(keys) <= set(Firmware(preset).parameters)
