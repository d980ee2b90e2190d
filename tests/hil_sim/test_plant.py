"""The plant follows the cell model to 1e-6 K and misses no peak between control periods."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bms.cell import (
    Branch,
    CellState,
    Disturbance,
    EntropyTable,
    ResistanceTable,
    integrate_step,
    polarisation_after_V,
    terminal_voltage_V,
)
from bms.presets import Preset, load_preset
from hil_sim.plant.disturbances import DisturbanceKind, disturbance_source
from hil_sim.plant.plant import SUB_STEPS, Extremes, Plant
from hil_sim.plant.true_cell import nominal_cell

CALM = Disturbance()


def bilinear(table, temperature_K, soc):
    column = [np.interp(soc, table.soc, row) for row in table.ohm]
    return np.interp(temperature_K, table.temperature_K, column)


def right_hand_side(preset: Preset, current_A, cooling_W, disturbance):
    """The cell's equations, with the voltages of its branches, written anew from the model."""
    cell, u = preset.cell, current_A
    Rc, Cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    Rs, Cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    Ci, charge_As = cell.coolant_heat_capacity_J_per_K, 3600.0 * cell.capacity_Ah
    R, tau = (
        np.array([(b.resistance_ohm, b.time_constant_s) for b in cell.branches]).reshape(-1, 2).T
    )

    def f(t, x):
        soc, Tc, Ts, Ti, *volts = x
        R0, E = cell.ohmic_resistance_ohm, cell.entropic_coefficient_V_per_K
        if cell.resistance is not None:
            R0 = bilinear(cell.resistance, Tc, soc)
        if cell.entropy is not None:
            E = np.interp(soc, cell.entropy.soc, cell.entropy.V_per_K)
        nu, V = disturbance(t), np.array(volts)
        heat_W = R0 * u**2 - E * Tc * u + np.sum(V**2 / R)
        return [
            -u / charge_As + nu[0],
            -(Tc - Ts) / (Rc * Cc) + heat_W / Cc + nu[1],
            -(Ts - Tc) / (Rc * Cs) - (Ts - Ti) / (Rs * Cs) + nu[2],
            -(Ti - Ts) / (Rs * Ci) - cooling_W / Ci + nu[3],
            *(-(V + u * R) / tau),
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
    expected = np.array([*plant.state, *plant.polarisation_V])
    for current_A in (-23.0, -23.0, -12.0, 0.0, -20.0, -5.0, -1.0, -2.3):
        plant.current_A = current_A
        for _ in range(1000):
            plant.advance()
        # In pieces, because a table has kinks that no step should straddle for long.
        for _ in range(50):
            expected = integrate(any_preset, expected, current_A, plant.cooling_power_W, (0, 2))
        assert np.abs(np.array([*plant.state, *plant.polarisation_V]) - expected).max() < 1e-6


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


REAL = replace(
    load_preset("lin2014").cell,
    resistance=ResistanceTable(
        (280.0, 300.0, 320.0), (0.0, 1.0), ((0.03, 0.02), (0.012, 0.011), (0.01, 0.01))
    ),
    entropy=EntropyTable((0.0, 0.5, 1.0), (-4e-4, 5e-5, 2e-4)),
    branches=(Branch(0.0025, 10.0), Branch(0.0035, 100.0)),
)


def plugged_in(preset, **changes):
    return replace(nominal_cell(replace(preset, cell=REAL)), **changes)


def test_a_real_cell_follows_a_tight_integrator_from_a_start_that_is_not_at_rest(preset):
    """Tables, branches, and core, surface and coolant each at a temperature of its own."""
    start = CellState(0.2, 306.0, 299.0, 290.0)
    plant = Plant(
        preset,
        itertools.repeat(CALM),
        plugged_in(preset, state=start, polarisation_V=(0.02, -0.01)),
    )
    expected = np.array([*start, 0.02, -0.01])
    for current_A in (-23.0, 0.0, -12.0):
        plant.current_A = current_A
        for _ in range(200):
            plant.advance()
        for _ in range(10):
            expected = integrate(
                replace(preset, cell=REAL), expected, current_A, plant.cooling_power_W, (0, 2)
            )
    assert np.abs(np.array([*plant.state, *plant.polarisation_V]) - expected).max() < 1e-6


def test_the_voltage_peak_of_a_polarised_cell_at_rest_is_its_first_instant(preset):
    plant = Plant(preset, itertools.repeat(CALM), plugged_in(preset, polarisation_V=(0.05, 0.0)))
    begin_V = plant.voltage_V
    assert begin_V == pytest.approx(float(REAL.ocv(preset.initial.soc)) + 0.05)
    for _ in range(10):
        plant.advance()
    assert plant.voltage_V < begin_V - 0.004
    assert plant.extremes.voltage_V == begin_V


def test_the_voltage_peak_of_a_cell_with_branches_is_that_of_the_finest_look(preset):
    """Currents that jump between periods: the peak is held against a look every millisecond."""
    random = np.random.default_rng(7)
    plant = Plant(preset, itertools.repeat(CALM), plugged_in(preset))
    state, volts, highest_V = plant.state, plant.polarisation_V, plant.voltage_V
    for current_A in random.uniform(-23.0, 0.0, 50):
        plant.current_A = float(current_A)
        plant.advance()
        for step in range(101):
            voltage_V = terminal_voltage_V(
                REAL, state.soc, current_A, state.core_temperature_K, volts
            )
            highest_V = max(highest_V, float(voltage_V))
            if step == 100:
                break
            state = integrate_step(
                REAL, state, current_A, plant.cooling_power_W, 1e-3, polarisation_V=volts
            )
            volts = polarisation_after_V(REAL, volts, current_A, 1e-3)
    assert plant.extremes.voltage_V == pytest.approx(highest_V, abs=1e-5)


def test_a_disturbance_that_grows_with_the_current_is_the_bound_at_that_current(preset):
    bounds = replace(preset.uncertainty, core_K_per_s=1e-3, core_K_per_As=2e-4, core_K_per_A2s=3e-5)
    grown = replace(preset, uncertainty=bounds)
    source = disturbance_source(DisturbanceKind.UPWARD, grown, 0.01, None)
    plant, calm = Plant(grown, source), Plant(grown, itertools.repeat(CALM))
    for current_A in (0.0, -5.0, -23.0):
        core_K = plant.state.core_temperature_K - calm.state.core_temperature_K
        plant.current_A = calm.current_A = current_A
        plant.advance()
        calm.advance()
        rise_K = plant.state.core_temperature_K - calm.state.core_temperature_K - core_K
        allowed_K_per_s = 1e-3 + 2e-4 * abs(current_A) + 3e-5 * current_A**2
        assert rise_K == pytest.approx(0.1 * allowed_K_per_s, rel=0.01)


def test_a_cooler_fades_out_over_the_last_kelvin_above_its_floor(preset):
    start = CellState(0.2, 276.5, 276.5, 276.5)
    true_cell = plugged_in(preset, state=start, cooling_power_W=3.0, coolant_floor_K=275.0)
    plant = Plant(preset, itertools.repeat(CALM), true_cell)
    assert plant.cooling_power_W == 3.0
    powers_W = []
    for _ in range(3000):
        plant.advance()
        powers_W.append((plant.state.coolant_temperature_K, plant.cooling_power_W))
    for coolant_K, power_W in powers_W:
        assert power_W == pytest.approx(3.0 * min(max(coolant_K - 275.0, 0.0), 1.0))
    assert powers_W[-1][0] > 275.0
    assert powers_W[-1][1] < 0.5
