"""The conditions as the theorem forms them, and the constants in force against them."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy

from bms.barrier import barrier_constants
from bms.barrier.derivation import Derivation, derive_cell_conditions
from bms.barrier.machinery import (
    AffineModel,
    check_gains,
    derive_condition,
    estimation_margin,
    require_sympy,
)
from bms.cell import CellState, Disturbance, integrate_step
from bms.errors import InputError
from bms.model.pair import load_pair
from bms.presets import load_preset, one_cell_preset_names
from bms.presets.paper_form import in_paper_form
from bms.verification.conditions import decided_conditions, firmware_constants

CELLS = 2


@cache
def derived() -> Derivation:
    return derive_cell_conditions()


def random_presets():
    """The shipped presets, also in the paper's form, and cells drawn around them.

    Both signs of the entropic coefficient.
    """
    random = np.random.default_rng(3)
    for name in one_cell_preset_names():
        preset = load_preset(name)
        yield preset
        yield in_paper_form(preset)
        for _ in range(CELLS):
            factors = {
                key: getattr(preset.cell, key) * float(np.exp(random.uniform(-1, 1)))
                for key in (
                    "core_resistance_K_per_W", "core_heat_capacity_J_per_K",
                    "surface_resistance_K_per_W", "surface_heat_capacity_J_per_K",
                    "coolant_heat_capacity_J_per_K", "ohmic_resistance_ohm",
                )
            }  # fmt: skip
            factors["entropic_coefficient_V_per_K"] = float(random.uniform(-2e-4, 2e-4))
            yield replace(preset, cell=replace(preset.cell, **factors))


@cache
def worst_case_surface():
    """The surface condition whose chain has the largest disturbance in it, at the worst case.

    Its first link is itself a barrier, and the theorem is asked about that one.
    """
    d, s = derived(), derived().symbols
    first, second = sympy.symbols("first second", positive=True)
    barrier = s.max_surface_temperature_K - s.surface_temperature_K
    link = -d.model.drift[2] - s.surface_K_per_s + first * barrier
    noise = d.model.disturbance
    bounds = dict(zip(noise[1:], (s.core_K_per_s, s.surface_K_per_s, s.coolant_K_per_s)))
    return first, second, derive_condition(d.model, link, [second]).worst_case(bounds)


def condition_in_force(name: str, preset):
    """A condition at the worst disturbance in the form of the preset, its states symbols."""
    d = derived()
    if (name, preset.gains.surface_condition) != ("surface", "worst-case"):
        return d.worst_case(name).subs(d.values(preset, 0.0))
    first, second, condition = worst_case_surface()
    smaller_per_s, larger_per_s = check_gains(
        [preset.gains.alpha3_per_s2, preset.gains.alpha4_per_s]
    )
    chain = {first: larger_per_s, second: smaller_per_s}
    return condition.subs(d.values(preset, 0.0) | chain)


def coefficients(name: str, preset) -> dict[str, float]:
    """Coefficients of a derived condition at true temperatures, as numbers."""
    s = derived().symbols
    condition = sympy.expand(condition_in_force(name, preset))
    states = {s.core_temperature_K: 0, s.surface_temperature_K: 0, s.coolant_temperature_K: 0}
    inputs = {s.current_A: 0, s.cooling_power_W: 0}

    def slope(*symbols):
        return float(sympy.diff(condition, *symbols).subs(states).subs(inputs))

    return {
        "core": slope(s.core_temperature_K),
        "surface": slope(s.surface_temperature_K),
        "coolant": slope(s.coolant_temperature_K),
        "coupling": slope(s.core_temperature_K, s.current_A),
        "squared": 0.5 * slope(s.current_A, s.current_A),
        "cooling": slope(s.cooling_power_W),
        "constant": float(condition.subs(states).subs(inputs)),
    }


def test_relative_degrees_are_those_of_the_paper():
    d = derived()

    assert (d.soc.relative_degree, d.core.relative_degree, d.surface.relative_degree) == (1, 1, 2)


def test_uncertainty_of_the_surface_is_the_sum_of_the_papers_theorem():
    d, s = derived(), derived().symbols
    rc, rs = s.core_resistance_K_per_W, s.surface_resistance_K_per_W
    cs = s.surface_heat_capacity_J_per_K
    _, core, surface, coolant = d.model.disturbance
    rate = d.surface.disturbances[1][2]

    expected = (
        -core / (rc * cs) + (1 / (rc * cs) + 1 / (rs * cs)) * surface - coolant / (rs * cs) - rate
    )

    assert sympy.simplify(d.surface.uncertainty - expected) == 0


@pytest.mark.parametrize("preset", list(random_presets()), ids=lambda p: p.name)
def test_constants_are_those_that_the_theorem_yields(preset):
    a, gains, limits = barrier_constants(preset.cell, preset), preset.gains, preset.limits
    gain = gains.core_gain_per_s(preset.cell)
    core, surface = coefficients("core", preset), coefficients("surface", preset)

    assert core == pytest.approx(
        {
            "core": a.a1_per_s - gain,
            "surface": -a.a1_per_s,
            "coolant": 0.0,
            "coupling": a.a2_per_As,
            "squared": -a.a3_K_per_A2s,
            "cooling": 0.0,
            "constant": gain * limits.max_core_temperature_K - preset.uncertainty.core_K_per_s,
        },
        rel=1e-9,
        abs=1e-15,
    )
    assert surface == pytest.approx(
        {
            "core": a.a4_per_s2,
            "surface": a.a5_per_s2,
            "coolant": a.a6_per_s2,
            "coupling": a.a8_per_As2,
            "squared": a.a9_K_per_A2s2,
            "cooling": a.a10_K_per_Ws2,
            "constant": a.a7_K_per_s2 - a.delta4_K_per_s2,
        },
        rel=1e-9,
        abs=1e-15,
    )


@pytest.mark.parametrize("preset", list(random_presets()), ids=lambda p: p.name)
@pytest.mark.parametrize("current_A", [-23.0, -1.0, 0.0])
def test_error_margins_are_the_absolute_slopes_over_the_estimate(preset, current_A):
    d = derived()
    a, e = barrier_constants(preset.cell, preset), 0.5
    gain = preset.gains.core_gain_per_s(preset.cell)
    expected = {
        "core": abs(a.a1_per_s - gain + a.a2_per_As * current_A) * e,
        "surface": abs(a.a4_per_s2 + a.a8_per_As2 * current_A) * e,
    }

    for name, margin in expected.items():
        difference = (d.worst_case(name) - d.robust(name)).subs(d.values(preset, e))
        value = float(difference.subs(d.symbols.current_A, current_A))
        assert value == pytest.approx(margin, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_the_firmwares_own_constants_are_those_that_the_theorem_yields(name):
    preset, model = load_pair(name, None)
    constants = firmware_constants(preset, model)

    for which, decided in zip(("core", "surface"), decided_conditions(constants)):
        expected = coefficients(which, preset)
        margin = constants["core_margin_K_per_s" if which == "core" else "surface_margin_K_per_s2"]
        found = {
            "core": decided.core_gap,
            "surface": -decided.core_gap - decided.coolant_gap - decided.room,
            "coolant": decided.coolant_gap,
            "coupling": decided.coupling,
            "squared": decided.squared,
            "cooling": decided.cooling,
            "constant": decided.room * decided.limit_K - decided.reserve + margin,
        }
        assert found == pytest.approx(expected, rel=1e-7, abs=1e-12)
        assert decided.error_bound_K == np.float32(model.error_bound_K)


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_the_conditions_are_the_derivatives_along_simulated_trajectories(name):
    preset, d = load_preset(name), derived()
    s, step_s = d.symbols, 0.01
    disturbance = Disturbance(0.0, 3e-4, -2e-4, 4e-4)
    middle = CellState(0.4, 315.0, 311.0, 303.0)
    inputs = {s.current_A: -13.0, s.cooling_power_W: 0.7}
    numbers = {
        **d.values(preset, 0.0), **inputs,
        **dict(zip(d.model.states, middle)), **dict(zip(d.model.disturbance, disturbance)),
    }  # fmt: skip
    before, after = (
        integrate_step(preset.cell, middle, -13.0, 0.7, sign * step_s, disturbance)
        for sign in (-1.0, 1.0)
    )
    limits, gains = preset.limits, preset.gains
    core = [limits.max_core_temperature_K - x.core_temperature_K for x in (before, middle, after)]
    surface = [
        limits.max_surface_temperature_K - x.surface_temperature_K for x in (before, middle, after)
    ]

    def value(condition):
        rates = [symbol for symbol in condition.disturbances[1] if symbol != 0]
        return float(condition.value.subs(numbers).subs(dict.fromkeys(rates, 0.0)))

    slope = (core[2] - core[0]) / (2 * step_s)
    assert value(d.core) == pytest.approx(
        slope + gains.core_gain_per_s(preset.cell) * core[1], abs=1e-5
    )
    slope = (surface[2] - surface[0]) / (2 * step_s)
    bend = (surface[2] - 2 * surface[1] + surface[0]) / step_s**2
    assert value(d.surface) == pytest.approx(
        bend + gains.alpha4_per_s * slope + gains.alpha3_per_s2 * surface[1], abs=1e-4
    )


@pytest.mark.parametrize("roots", [(0.1, 0.5), (0.3, 0.3), (1.0, 2.0, 3.0)])
def test_gains_with_real_negative_roots_give_the_chain(roots):
    gains = list(reversed(np.poly([-root for root in roots])[1:]))

    assert check_gains(gains) == pytest.approx(roots, rel=1e-6)


@pytest.mark.parametrize(
    ("gains", "reason"),
    [([0.05, 0.4], "complex roots"), ([-0.05, 0.6], "not Hurwitz"), ([0.05, -0.6], "not Hurwitz")],
)
def test_gains_that_make_no_chain_are_refused(gains, reason):
    with pytest.raises(InputError, match=reason):
        check_gains(gains)


def oscillator(disturbance):
    x, v, u = sympy.symbols("x v u", real=True)
    return x, AffineModel((x, v), (v, -(x**3)), {"u": u}, {"u": (0, 1)}, disturbance(x))


def test_any_affine_model_is_taken():
    x, model = oscillator(lambda _: (0, sympy.Symbol("w")))

    condition = derive_condition(model, 1 - x, [6, 5])

    v, u, w = model.states[1], model.inputs["u"], model.disturbance[1]
    assert condition.relative_degree == 2
    assert sympy.expand(condition.value - (x**3 - u - w + 5 * (-v) + 6 * (1 - x))) == 0
    assert sympy.expand(condition.worst_case({w: 2}) - (x**3 - u - 2 - 5 * v + 6 - 6 * x)) == 0
    with pytest.raises(InputError, match="not linear in x"):
        estimation_margin(condition.value, x, 1)


def test_what_the_theorem_does_not_cover_is_refused():
    x, model = oscillator(lambda _: (0, sympy.Symbol("w")))
    with pytest.raises(InputError, match="relative degree is 2"):
        derive_condition(model, 1 - x, [1])
    with pytest.raises(InputError, match="no input"):
        derive_condition(replace(model, columns={"u": (0, 0)}), 1 - x, [1, 1])
    noise = sympy.Symbol("w")
    curved = replace(model, drift=(model.states[1] ** 2, 0), disturbance=(0, noise))
    condition = derive_condition(
        replace(curved, drift=(model.states[1], 0)), 1 - model.states[1] ** 2, [1]
    )
    assert condition.relative_degree == 1
    squared = replace(condition, value=noise**2)
    with pytest.raises(InputError, match="not linear in the disturbance"):
        squared.worst_case({noise: 1})


def test_without_sympy_there_is_one_clear_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "sympy", None)

    with pytest.raises(InputError, match=r"kan-rcbf-bms\[theory\]"):
        require_sympy()
