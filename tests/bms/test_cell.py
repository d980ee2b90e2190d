"""The cell model against an independent integrator, its energy balance and its OCV table."""

from __future__ import annotations

import csv
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator

from bms.cell import (
    CellParameters,
    CellState,
    Disturbance,
    OpenCircuitVoltage,
    integrate_step,
    rates,
    terminal_voltage_V,
)
from bms.errors import InputError
from bms.presets import load_preset, preset_names

MEASURED = Path(__file__).parents[3] / "shared/data"
MEASURED_OCV = MEASURED / "a123_26650_ocv_25degC.csv"
SLOW_DISCHARGE = MEASURED / "samsung_30q_s001_c10.csv"
STEP_S = 0.01
CELL = load_preset("lin2014").cell

cells_of_constants = pytest.mark.parametrize(
    "name", [n for n in preset_names() if load_preset(n).cell.resistance is None]
)


def equations(cell, state, current_A, cooling_W, disturbance):
    """The four equations of design page 1, term by term, with every symbol as printed there."""
    _, tc, ts, tinf = state
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    cinf, r0 = cell.coolant_heat_capacity_J_per_K, cell.ohmic_resistance_ohm
    e, u = cell.entropic_coefficient_V_per_K, current_A
    nu_soc, nu_c, nu_s, nu_inf = disturbance
    return [
        -u / (cell.capacity_Ah * 3600) + nu_soc,
        -(tc - ts) / (rc * cc) - (e * tc / cc) * u + (r0 / cc) * u**2 + nu_c,
        -(ts - tc) / (rc * cs) - (ts - tinf) / (rs * cs) + nu_s,
        -(tinf - ts) / (rs * cinf) - cooling_W / cinf + nu_inf,
    ]


@cells_of_constants
def test_a_full_charge_agrees_with_a_tight_integrator_to_a_microkelvin(name):
    """Currents and cooling constant over 20 s, disturbances linear from sub-step to sub-step."""
    preset = load_preset(name)
    cell, piece_s = preset.cell, 20.0
    random = np.random.default_rng(5)
    start_K = preset.initial.temperature_K
    ours = CellState(preset.initial.soc, start_K, start_K, start_K)
    reference = np.array(ours, dtype=float)
    worst_K, elapsed_s = 0.0, 0.0
    while ours.soc < preset.limits.completion_soc:
        current_A = preset.limits.reference_current_A * random.choice([1.0, 1.0, 0.5, 0.0])
        cooling_W = random.uniform(*preset.operating_box.cooling_power_W)
        knots_s = np.linspace(0.0, piece_s, round(piece_s) + 1)
        amplitudes = np.array([0.0, 5e-4, 5e-4, 5e-4])
        knots = amplitudes * random.uniform(-1.0, 1.0, (len(knots_s), 4))

        for start_s, end_s, before, after in zip(knots_s, knots_s[1:], knots, knots[1:]):

            def right_side(time_s, x, start_s=start_s, before=before, slope=after - before):
                disturbance = before + slope * (time_s - start_s)
                return equations(cell, x, current_A, cooling_W, disturbance)  # noqa: B023

            solution = solve_ivp(
                right_side, (start_s, end_s), reference, method="DOP853", rtol=1e-12, atol=1e-12
            )
            reference = solution.y[:, -1]
            steps = round((end_s - start_s) / STEP_S)
            line = before + np.linspace(0.0, 1.0, steps + 1)[:, None] * (after - before)
            for left, right in pairwise(line):
                ours = integrate_step(
                    cell,
                    ours,
                    current_A,
                    cooling_W,
                    STEP_S,
                    Disturbance(*left),
                    Disturbance(*right),
                )
            worst_K = max(worst_K, np.max(np.abs(np.array(ours)[1:] - reference[1:])))
            assert ours.soc == pytest.approx(reference[0], abs=1e-12)
        elapsed_s += piece_s
    assert elapsed_s > 300.0
    assert worst_K < 1e-6


finite = st.floats(-50.0, 50.0)
temperatures = st.floats(250.0, 350.0)


@given(finite, finite, temperatures, temperatures, temperatures)
def test_stored_heat_changes_by_generated_less_removed_heat(current_A, cooling_W, tc, ts, tinf):
    rate = rates(CELL, CellState(0.5, tc, ts, tinf), current_A, cooling_W)
    stored_W = (
        CELL.core_heat_capacity_J_per_K * rate.core_temperature_K
        + CELL.surface_heat_capacity_J_per_K * rate.surface_temperature_K
        + CELL.coolant_heat_capacity_J_per_K * rate.coolant_temperature_K
    )
    generated_W = (
        CELL.ohmic_resistance_ohm * current_A**2
        - CELL.entropic_coefficient_V_per_K * tc * current_A
    )
    assert stored_W == pytest.approx(generated_W - cooling_W, abs=1e-9)


@given(finite, finite, temperatures, temperatures, temperatures)
def test_rates_are_the_printed_equations(current_A, cooling_W, tc, ts, tinf):
    state, disturbance = CellState(0.3, tc, ts, tinf), Disturbance(1e-6, 2e-4, -3e-4, 4e-4)
    expected = equations(CELL, state, current_A, cooling_W, disturbance)
    assert rates(CELL, state, current_A, cooling_W, disturbance) == pytest.approx(
        expected, rel=1e-12, abs=1e-12
    )


def test_one_equal_temperature_and_no_current_stay_as_they_are():
    rest = CellState(0.4, 300.0, 300.0, 300.0)
    assert integrate_step(CELL, rest, 0.0, 0.0, 10.0) == rest


def test_charging_raises_the_state_of_charge_and_the_terminal_voltage():
    state = CellState(0.4, 300.0, 300.0, 300.0)
    assert integrate_step(CELL, state, -2.3, 0.0, 3600.0 * 0.1).soc == pytest.approx(0.5)
    assert terminal_voltage_V(CELL, 0.5, -10.0) - terminal_voltage_V(CELL, 0.5, 0.0) == (
        pytest.approx(10.0 * CELL.ohmic_resistance_ohm)
    )


def test_many_cells_at_once_give_what_each_gives_alone():
    currents_A = np.array([-23.0, -5.0, 0.0, 3.0])
    state = CellState(
        np.full(4, 0.3), np.linspace(290, 320, 4), np.full(4, 295.0), np.full(4, 293.0)
    )
    together = integrate_step(CELL, state, currents_A, 1.0, 0.1)
    for index, current_A in enumerate(currents_A):
        alone = integrate_step(CELL, CellState(*(x[index] for x in state)), current_A, 1.0, 0.1)
        assert [column[index] for column in together] == pytest.approx(list(alone), rel=1e-15)


@pytest.mark.parametrize("name", [n for n in preset_names() if n != "samsung_30q"])
def test_ocv_table_follows_the_measurement(name):
    if not MEASURED_OCV.exists():
        pytest.skip(f"not run: {MEASURED_OCV} is absent")
    with MEASURED_OCV.open() as file:
        rows = [(float(row["soc"]), float(row["ocv_V"])) for row in csv.DictReader(file)]
    soc, measured_V = np.array(rows).T
    assert np.max(np.abs(load_preset(name).cell.ocv(soc) - measured_V)) <= 2e-3


def test_ocv_of_the_30q_is_a_slow_discharge_with_the_drop_over_its_resistances_added():
    """C/10 to empty; after ten minutes the branches carry the whole current."""
    if not SLOW_DISCHARGE.exists():
        pytest.skip(f"not run: {SLOW_DISCHARGE} is absent")
    cell = load_preset("samsung_30q").cell
    assert cell.resistance is not None
    table = np.genfromtxt(SLOW_DISCHARGE, delimiter=",", encoding="utf-8-sig")
    time_s, discharge_A, voltage_V, surface_K = (
        *(table[:, :3] * [1, -1, 1]).T,
        table[:, 4] + 273.15,
    )
    charge_As = np.concatenate([[0.0], np.cumsum(np.diff(time_s) * discharge_A[1:])])
    soc = (charge_As[-1] - charge_As) / cell.capacity_As
    ohmic = RegularGridInterpolator(
        (cell.resistance.temperature_K, cell.resistance.soc), np.array(cell.resistance.ohm)
    )(np.stack([surface_K, np.minimum(soc, cell.resistance.soc[-1])], axis=1))
    drop_V = discharge_A * (ohmic + sum(branch.resistance_ohm for branch in cell.branches))
    loaded = (time_s > 600.0) & (discharge_A > 0.1)

    apart_V = np.abs(cell.ocv(soc) - (voltage_V + drop_V))[loaded]

    assert np.count_nonzero(loaded) > 1000 and np.min(soc[loaded]) < 1e-3
    assert np.max(apart_V) <= 6e-3
    assert np.sqrt(np.mean(apart_V**2)) <= 1.5e-3


def test_ocv_is_linear_between_points_and_constant_outside():
    ocv = OpenCircuitVoltage((0.0, 0.5, 1.0), (2.0, 3.0, 3.5))
    assert ocv([-1.0, 0.25, 0.5, 0.75, 2.0]).tolist() == [2.0, 2.5, 3.0, 3.25, 3.5]
    assert ocv.soc_at([1.0, 2.5, 3.25, 4.0]).tolist() == [0.0, 0.25, 0.75, 1.0]


def test_largest_rise_of_the_ocv_is_that_of_a_dense_search():
    random = np.random.default_rng(3)
    for _ in range(50):
        soc = np.unique(np.concatenate([[0.0, 1.0], random.uniform(0.0, 1.0, 6)]))
        ocv = OpenCircuitVoltage(
            tuple(soc.tolist()),
            tuple((3.0 + np.cumsum(random.exponential(0.1, len(soc)))).tolist()),
        )
        charge, (first, last) = random.uniform(0.0, 0.2), np.sort(random.uniform(0.0, 1.0, 2))
        starts = np.linspace(first, last, 100_001)

        found_V = float(ocv.largest_rise_V(charge, first, last))

        searched_V = np.max(ocv(starts + charge) - ocv(starts))
        assert found_V >= searched_V - 1e-12
        assert found_V == pytest.approx(searched_V, abs=1e-3)


def test_the_ocv_does_not_rise_where_there_is_no_start():
    ocv = OpenCircuitVoltage((0.0, 0.5, 1.0), (2.0, 3.0, 3.5))
    assert ocv.largest_rise_V([0.1, 0.1], [0.6, 0.4], [0.5, 0.6]).tolist() == [
        0.0,
        pytest.approx(0.2),
    ]


@pytest.mark.parametrize(
    ("soc", "voltage_V"),
    [
        ((0.0, 1.0), (2.0,)),
        ((0.0,), (2.0,)),
        ((0.1, 1.0), (2.0, 3.0)),
        ((0.0, 0.9), (2.0, 3.0)),
        ((0.0, 0.5, 0.5, 1.0), (2.0, 2.5, 2.6, 3.0)),
        ((0.0, 0.5, 1.0), (2.0, 2.0, 3.0)),
        ((0.0, math.nan, 1.0), (2.0, 2.5, 3.0)),
    ],
)
def test_an_ocv_table_that_is_no_rising_curve_over_0_to_1_is_refused(soc, voltage_V):
    with pytest.raises(InputError, match="ocv"):
        OpenCircuitVoltage(soc, voltage_V)


def test_capacity_in_ampere_seconds():
    assert CELL.capacity_As == pytest.approx(2.3 * 3600)
    assert isinstance(CELL, CellParameters)
