"""The plant follows the cell model to 1e-6 K and misses no peak between control periods."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bms.cell import Disturbance
from bms.presets import Preset
from hil_sim.plant.plant import SUB_STEPS, Extremes, Plant

CALM = Disturbance()


def right_hand_side(preset: Preset, current_A, cooling_W, disturbance):
    """The cell's equations, written anew from the model's description."""
    cell = preset.cell
    Rc, Cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    Rs, Cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    Ci, R0 = cell.coolant_heat_capacity_J_per_K, cell.ohmic_resistance_ohm
    E, charge_As = cell.entropic_coefficient_V_per_K, 3600.0 * cell.capacity_Ah

    def f(t, x):
        _, Tc, Ts, Ti = x
        nu = disturbance(t)
        return [
            -current_A / charge_As + nu[0],
            -(Tc - Ts) / (Rc * Cc) - E * Tc / Cc * current_A + R0 / Cc * current_A**2 + nu[1],
            -(Ts - Tc) / (Rc * Cs) - (Ts - Ti) / (Rs * Cs) + nu[2],
            -(Ti - Ts) / (Rs * Ci) - cooling_W / Ci + nu[3],
        ]

    return f


def integrate(preset, state, current_A, cooling_W, span_s, disturbance=lambda t: (0, 0, 0, 0)):
    return solve_ivp(
        right_hand_side(preset, current_A, cooling_W, disturbance),
        span_s,
        state,
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
    ).y[:, -1]


def test_plant_agrees_with_a_tight_integrator_over_a_whole_charge(any_preset):
    plant = Plant(any_preset, itertools.repeat(CALM))
    expected = np.array(plant.state)
    for current_A in (-23.0, -23.0, -12.0, 0.0, -20.0, -5.0, -1.0, -2.3):
        plant.current_A = current_A
        for _ in range(1000):
            plant.advance()
        expected = integrate(any_preset, expected, current_A, plant.cooling_power_W, (0, 100))
        assert np.abs(np.array(plant.state) - expected).max() < 1e-6


def test_disturbance_runs_linearly_between_its_knots(preset):
    rng = np.random.default_rng(3)
    knots = rng.uniform(-0.05, 0.05, (1 + 20 * SUB_STEPS, 4)) * [1e-3, 1, 1, 1]
    plant = Plant(preset, iter([Disturbance(*row) for row in knots.tolist()]))
    plant.current_A = -23.0
    expected, step_s = np.array(plant.state), preset.timing.sampling_period_s / SUB_STEPS
    for k in range(20 * SUB_STEPS):
        before, after = knots[k], knots[k + 1]
        expected = integrate(
            preset,
            expected,
            -23.0,
            plant.cooling_power_W,
            (0, step_s),
            lambda t, a=before, b=after: a + (b - a) * t / step_s,
        )
    for _ in range(20):
        plant.advance()
    assert np.abs(np.array(plant.state) - expected).max() < 1e-9


def test_a_peak_between_two_control_periods_is_on_record(preset):
    """Heat for half a period, then cool: both ends are lower than the middle."""
    kick = [Disturbance(0.01, 50.0, 50.0, 0.0)] * (SUB_STEPS // 2)
    back = [Disturbance(-0.01, -50.0, -50.0, 0.0)] * (SUB_STEPS // 2 + 1)
    plant = Plant(preset, iter(kick + back))
    start = plant.state
    plant.advance()
    end, peak = plant.state, plant.extremes
    assert peak.core_temperature_K > max(start.core_temperature_K, end.core_temperature_K) + 1.0
    assert peak.surface_temperature_K > (
        max(start.surface_temperature_K, end.surface_temperature_K) + 1.0
    )
    assert peak.soc > max(start.soc, end.soc)
    assert peak.voltage_V == pytest.approx(float(preset.cell.ocv(peak.soc)))


def test_voltage_peak_counts_from_the_instant_of_a_new_current(preset):
    plant = Plant(preset, itertools.repeat(CALM))
    plant.current_A = -10.0
    at_switch_V = plant.voltage_V
    assert at_switch_V == pytest.approx(
        float(preset.cell.ocv(preset.initial.soc)) + 10.0 * preset.cell.ohmic_resistance_ohm
    )
    plant.advance()
    assert plant.extremes.voltage_V >= at_switch_V


@pytest.mark.parametrize(
    ("field", "limit"),
    [
        ("core_temperature_K", "max_core_temperature_K"),
        ("surface_temperature_K", "max_surface_temperature_K"),
        ("voltage_V", "max_voltage_V"),
        ("soc", "max_soc"),
    ],
)
def test_limit_is_kept_exactly_on_it_and_violated_one_step_above(preset, field, limit):
    on_limits = Extremes(
        core_temperature_K=preset.limits.max_core_temperature_K,
        surface_temperature_K=preset.limits.max_surface_temperature_K,
        voltage_V=preset.limits.max_voltage_V,
        soc=preset.limits.max_soc,
    )
    assert on_limits.violations(preset.limits) == []
    above = math.nextafter(getattr(preset.limits, limit), math.inf)
    assert len(replace(on_limits, **{field: above}).violations(preset.limits)) == 1
    assert len(replace(on_limits, **{field: math.nan}).violations(preset.limits)) == 1
