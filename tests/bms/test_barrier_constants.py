"""Every constant of the four constraints follows from the cell model by differentiation alone.

sympy forms the Lie derivatives of the barriers along the model, disturbances included, and reads
the coefficients off; nothing here is copied from the paper's table but the names.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from bms.barrier import barrier_constants
from bms.barrier.constraints import left_hand_sides
from bms.cell import CellState
from bms.presets import load_preset, one_cell_preset_names
from bms.presets.schema import Gains

RC, CC, RS, CS, CINF, R0, E, CBAT = sp.symbols("Rc Cc Rs Cs Cinf R0 E Cbat", positive=True)
SOC, TC, TS, TINF, U, QC, ERROR = sp.symbols("SoC Tc Ts Tinf u Qc e")
ALPHA = sp.symbols("alpha1:5", positive=True)
SOC_MAX, TC_MAX, TS_MAX = sp.symbols("SoCmax Tcmax Tsmax", positive=True)
NU = sp.symbols("nu_soc nu_c nu_s nu_inf")
NU_S_RATE = sp.Symbol("dnu_s")
ROOTS = sp.symbols("lambda1:3", positive=True)
"""Rates of the surface's chain: alpha4 is their sum, alpha3 their product."""
NU_S_BOUND = sp.Symbol("nu_s_bound")
FORMS = ("paper", "worst-case")

MODEL = (
    -U / CBAT + NU[0],
    -(TC - TS) / (RC * CC) - (E * TC / CC) * U + (R0 / CC) * U**2 + NU[1],
    -(TS - TC) / (RC * CS) - (TS - TINF) / (RS * CS) + NU[2],
    -(TINF - TS) / (RS * CINF) - QC / CINF + NU[3],
)
STATES = (SOC, TC, TS, TINF)


def along_model(function):
    """Time derivative along the model; nu_s is the only disturbance that gets differentiated."""
    return sum(sp.diff(function, x) * rate for x, rate in zip(STATES, MODEL)) + (
        sp.diff(function, NU[2]) * NU_S_RATE
    )


@cache
def left_sides(form):
    """Left-hand sides of the SoC, core and surface constraints for the true state.

    The paper differentiates the surface's rate with its disturbance in it. In the worst case the
    first link of the chain has the largest disturbance in its place, which is a constant.
    """
    soc, core, surface = SOC_MAX - SOC, TC_MAX - TC, TS_MAX - TS
    rate = along_model(surface)
    link = rate.subs(NU[2], NU_S_BOUND) + ROOTS[0] * surface
    of_surface = {
        "paper": along_model(rate) + ALPHA[3] * rate + ALPHA[2] * surface,
        "worst-case": along_model(link) + ROOTS[1] * link,
    }
    return tuple(
        sp.expand(side)
        for side in (
            along_model(soc) + ALPHA[0] * soc,
            along_model(core) + ALPHA[1] * core,
            of_surface[form],
        )
    )


def coefficient(side, *symbols):
    """Coefficient of a product of symbols, everything else that varies set to zero."""
    product = sp.Mul(*symbols)
    variables = (TC, TS, TINF, U, QC, *NU, NU_S_RATE, NU_S_BOUND)
    return sp.Poly(side, *variables).coeff_monomial(product)


@cache
def derived(form="paper"):
    """The constants by name, read off the derived left-hand sides."""
    _, core, surface = left_sides(form)
    return {
        "a1_per_s": -coefficient(core, TS),
        "a2_per_As": coefficient(core, TC, U),
        "a3_K_per_A2s": -coefficient(core, U, U),
        "a4_per_s2": coefficient(surface, TC),
        "a5_per_s2": coefficient(surface, TS),
        "a6_per_s2": coefficient(surface, TINF),
        "a7_K_per_s2": coefficient(surface, 1),
        "a8_per_As2": coefficient(surface, TC, U),
        "a9_K_per_A2s2": coefficient(surface, U, U),
        "a10_K_per_Ws2": coefficient(surface, QC),
    }


@cache
def disturbed(form):
    """(bound by name, slope of the surface's side) of all that disturbs it."""
    _, _, surface = left_sides(form)
    return [
        ("core_K_per_s", coefficient(surface, NU[1])),
        ("surface_K_per_s", coefficient(surface, NU[2])),
        ("surface_K_per_s", coefficient(surface, NU_S_BOUND)),
        ("coolant_K_per_s", coefficient(surface, NU[3])),
        ("surface_rate_K_per_s2", coefficient(surface, NU_S_RATE)),
    ]


def numbers(cell, preset):
    """What each symbol of the model stands for."""
    limits, gains = preset.limits, preset.gains
    # The first link has the larger root: it asks less of a state.
    roots_per_s = sorted(-np.roots([1.0, gains.alpha4_per_s, gains.alpha3_per_s2]), reverse=True)
    return {
        RC: cell.core_resistance_K_per_W,
        CC: cell.core_heat_capacity_J_per_K,
        RS: cell.surface_resistance_K_per_W,
        CS: cell.surface_heat_capacity_J_per_K,
        CINF: cell.coolant_heat_capacity_J_per_K,
        R0: cell.ohmic_resistance_ohm,
        E: cell.entropic_coefficient_V_per_K,
        CBAT: cell.capacity_As,
        ALPHA[0]: gains.alpha1_per_s,
        ALPHA[1]: gains.core_gain_per_s(cell),
        ALPHA[2]: gains.alpha3_per_s2,
        ALPHA[3]: gains.alpha4_per_s,
        ROOTS[0]: roots_per_s[0],
        ROOTS[1]: roots_per_s[1],
        NU_S_BOUND: preset.uncertainty.surface_K_per_s,
        SOC_MAX: limits.max_soc,
        TC_MAX: limits.max_core_temperature_K,
        TS_MAX: limits.max_surface_temperature_K,
    }


def value(expression, cell, preset):
    return float(expression.subs(numbers(cell, preset)))


def random_cell(draw_from):
    """A cell with every parameter somewhere within a factor of four of a published one."""
    cell = load_preset("lin2014").cell
    factors = np.exp(draw_from.uniform(-1.4, 1.4, 7))
    thermal = (
        "core_resistance_K_per_W",
        "core_heat_capacity_J_per_K",
        "surface_resistance_K_per_W",
        "surface_heat_capacity_J_per_K",
        "coolant_heat_capacity_J_per_K",
        "ohmic_resistance_ohm",
    )
    changed = {name: getattr(cell, name) * f for name, f in zip(thermal, factors)}
    entropy = 4e-4 * factors[-1] * draw_from.choice([-1.0, 1.0])
    return replace(cell, **changed, entropic_coefficient_V_per_K=float(entropy))


def in_form(preset, form):
    return replace(preset, gains=replace(preset.gains, surface_condition=form))


def cells():
    """Both presets, and random cells with the first preset's limits and gains."""
    shipped = [load_preset(name) for name in one_cell_preset_names()]
    random = np.random.default_rng(6)
    gains = Gains(alpha1_per_s=0.02, alpha2_per_s=0.03, alpha3_per_s2=0.08, alpha4_per_s=0.7)
    other = replace(shipped[0], gains=gains)
    return [(preset.cell, preset) for preset in shipped] + [
        (random_cell(random), preset) for preset in (shipped[0], other) * 5
    ]


def test_relative_degrees_are_one_one_and_two():
    barriers = (SOC_MAX - SOC, TC_MAX - TC, TS_MAX - TS)
    has_input = [along_model(barrier).has(U) for barrier in barriers]
    assert has_input == [True, True, False]
    assert along_model(along_model(barriers[2])).has(U)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", list(derived()))
def test_constant_follows_from_the_model(name, form):
    expression = derived(form)[name]
    for cell, preset in cells():
        constants = barrier_constants(cell, in_form(preset, form))
        assert getattr(constants, name) == pytest.approx(value(expression, cell, preset), rel=1e-10)


@pytest.mark.parametrize("form", FORMS)
def test_disturbance_margin_is_the_worst_case_of_every_disturbance(form):
    for cell, preset in cells():
        worst = sum(
            abs(value(expression, cell, preset)) * getattr(preset.uncertainty, name)
            for name, expression in disturbed(form)
        )
        delta4 = barrier_constants(cell, in_form(preset, form)).delta4_K_per_s2
        assert delta4 == pytest.approx(worst, rel=1e-10)


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_shipped_presets_assume_no_slope_of_the_surface_disturbance(name):
    preset = load_preset(name)
    wilder = replace(preset.uncertainty, surface_rate_K_per_s2=1e6)

    assert barrier_constants(preset.cell, preset) == barrier_constants(
        preset.cell, replace(preset, uncertainty=wilder)
    )


def test_estimation_error_enters_by_a1_minus_alpha2_and_a4_with_their_current_terms():
    _, core, surface = left_sides("paper")
    constants = derived()
    for side, expected in (
        (core, constants["a1_per_s"] - ALPHA[1] + constants["a2_per_As"] * U),
        (surface, constants["a4_per_s2"] + constants["a8_per_As2"] * U),
    ):
        change = side.subs(TC, TC + ERROR) - side
        assert sp.simplify(change - expected * ERROR) == 0


def worst_sides(cell, preset, state, cooling_W, current_A, error_bound_K):
    """SoC, core and surface side at the worst corner of estimation error and disturbances."""
    bounds = preset.uncertainty
    amplitudes = (
        error_bound_K,
        bounds.soc_per_s,
        bounds.core_K_per_s,
        bounds.surface_K_per_s,
        bounds.coolant_K_per_s,
        bounds.surface_rate_K_per_s2,
    )
    corners = np.array(list(itertools.product([-1.0, 1.0], repeat=len(amplitudes)))).T
    error_K, *disturbances = np.array(amplitudes)[:, None] * corners
    soc, tc, ts, tinf = state
    true_state = (soc, tc + error_K, ts, tinf)
    sides = _numeric_sides(preset.gains.surface_condition)(
        *numbers(cell, preset).values(), *true_state, current_A, cooling_W, *disturbances
    )
    return [float(np.min(side)) for side in sides]


@given(
    seed=st.integers(0, 2**32 - 1),
    current_A=st.floats(-25.0, 0.0),
    error_bound_K=st.floats(0.0, 2.0),
    name=st.sampled_from(one_cell_preset_names()),
    form=st.sampled_from(FORMS),
)
def test_left_hand_sides_are_the_worst_case_over_errors_and_disturbances(
    seed, current_A, error_bound_K, name, form
):
    random = np.random.default_rng(seed)
    preset = in_form(load_preset(name), form)
    preset = replace(preset, uncertainty=replace(preset.uncertainty, soc_per_s=1e-5))
    cell = random_cell(random)
    state = CellState(random.uniform(0.0, 1.0), *random.uniform(280.0, 330.0, 3))
    cooling_W = random.uniform(0.0, 3.0)
    ours = left_hand_sides(
        cell, preset, barrier_constants(cell, preset), state, cooling_W, current_A, error_bound_K
    )
    expected = worst_sides(cell, preset, state, cooling_W, current_A, error_bound_K)
    assert list(ours[1:]) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert ours.voltage_V == pytest.approx(
        preset.limits.max_voltage_V - (cell.ocv(state.soc) - current_A * cell.ohmic_resistance_ohm)
    )


@cache
def _numeric_sides(form):
    cell, preset = load_preset("lin2014").cell, load_preset("lin2014")
    arguments = (*numbers(cell, preset), *STATES, U, QC, *NU, NU_S_RATE)
    return sp.lambdify(arguments, left_sides(form))


@given(
    current_A=st.floats(-25.0, 0.0),
    temperatures_K=st.tuples(*[st.floats(270.0, 330.0)] * 3),
    cooling_W=st.floats(0.0, 5.0),
    name=st.sampled_from(one_cell_preset_names()),
)
def test_temperature_differences_give_the_printed_sum(current_A, temperatures_K, cooling_W, name):
    preset = load_preset(name)
    a = barrier_constants(preset.cell, preset)
    tc, ts, tinf = temperatures_K
    printed = (
        a.a4_per_s2 * tc + a.a5_per_s2 * ts + a.a6_per_s2 * tinf + a.a7_K_per_s2
        + a.a8_per_As2 * tc * current_A + a.a9_K_per_A2s2 * current_A**2
        + a.a10_K_per_Ws2 * cooling_W - a.delta4_K_per_s2
    )  # fmt: skip
    state = CellState(0.5, tc, ts, tinf)
    ours = left_hand_sides(preset.cell, preset, a, state, cooling_W, current_A)
    assert ours.surface_K_per_s2 == pytest.approx(printed, abs=1e-11)


def test_arrays_of_cells_give_what_each_gives_alone():
    both = [load_preset(name) for name in one_cell_preset_names()]
    names = ("core_resistance_K_per_W", "surface_heat_capacity_J_per_K", "ohmic_resistance_ohm")
    stacked = {name: np.array([getattr(preset.cell, name) for preset in both]) for name in names}
    first = both[0]
    together = barrier_constants(replace(first.cell, **stacked), first)
    for index, preset in enumerate(both):
        alone = replace(first.cell, **{name: getattr(preset.cell, name) for name in names})
        assert together.a5_per_s2[index] == pytest.approx(
            barrier_constants(alone, first).a5_per_s2, rel=1e-14
        )


PRINTED_CONSTANTS = {
    "A5 with C_bat": ("a5_per_s2", {CINF: CBAT}),
    "A6 with C_bat": ("a6_per_s2", {CINF: CBAT}),
    "A10 with C_bat": ("a10_K_per_Ws2", {CINF: CBAT}),
    "A9 with R_s": ("a9_K_per_A2s2", {R0: RS}),
}
"""Slips in the paper's table (design page 1, section 4): the constant and what is confused."""


@pytest.mark.parametrize("slip", PRINTED_CONSTANTS)
@pytest.mark.parametrize("preset_name", one_cell_preset_names())
def test_a_constant_as_the_paper_prints_it_does_not_pass(slip, preset_name):
    name, confused = PRINTED_CONSTANTS[slip]
    preset = load_preset(preset_name)
    printed = value(derived()[name].subs(confused), preset.cell, preset)
    assert getattr(barrier_constants(preset.cell, preset), name) != pytest.approx(printed, rel=1e-3)


CORE, SURFACE = 1, 2
PRINTED_SIDES = {
    "core with + nu_c": (CORE, 1.0, lambda a, u, e, nu_c: 2.0 * nu_c),
    "core error without absolute value": (
        CORE,
        -1.0,
        lambda a, u, e, nu_c: a.a2_per_As * u * e + abs(a.a2_per_As * u) * e,
    ),
    "surface without estimation error": (
        SURFACE,
        1.0,
        lambda a, u, e, nu_c: abs(a.a4_per_s2 + a.a8_per_As2 * u) * e,
    ),
}
"""Slips in the constraints: side, sign of E that shows it, how much it claims too much."""


@pytest.mark.parametrize("slip", PRINTED_SIDES)
@pytest.mark.parametrize("preset_name", one_cell_preset_names())
def test_a_constraint_as_the_paper_prints_it_claims_more_than_holds(slip, preset_name):
    index, sign, excess = PRINTED_SIDES[slip]
    preset = load_preset(preset_name)
    entropy = sign * abs(preset.cell.entropic_coefficient_V_per_K)
    cell = replace(preset.cell, entropic_coefficient_V_per_K=entropy)
    state, cooling_W, current_A, error_K = CellState(0.5, 318.0, 315.0, 310.0), 0.5, -20.0, 1.0
    a = barrier_constants(cell, preset)
    ours = left_hand_sides(cell, preset, a, state, cooling_W, current_A, error_K)[index + 1]
    holds = worst_sides(cell, preset, state, cooling_W, current_A, error_K)[index]
    printed = ours + excess(a, current_A, error_K, preset.uncertainty.core_K_per_s)
    assert ours == pytest.approx(holds, abs=1e-9)
    assert printed > holds + 1e-6
