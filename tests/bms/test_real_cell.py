"""A cell with tables, branches and others of its family, against equations that are written out."""

from __future__ import annotations

import itertools
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bms.cell import (
    Branch,
    CellFactors,
    CellState,
    Disturbance,
    EntropyTable,
    ResistanceTable,
    at_rest_V,
    integrate_step,
    polarisation_after_V,
    rates,
    scaled,
    terminal_voltage_V,
)
from bms.presets import load_preset

STEP_S = 0.01
PLAIN = load_preset("lin2014").cell
OHM = ResistanceTable(
    temperature_K=(278.15, 288.15, 298.15, 308.15, 318.15),
    soc=(0.0, 0.3, 1.0),
    ohm=(
        (0.0241, 0.0230, 0.0260),
        (0.0163, 0.0150, 0.0180),
        (0.0110, 0.0099, 0.0120),
        (0.0114, 0.0105, 0.0109),
        (0.0102, 0.0100, 0.0104),
    ),
)
ENTROPY = EntropyTable(
    soc=(0.0, 0.1, 0.4, 0.7, 1.0), V_per_K=(-3.6e-4, -4.6e-4, -5.1e-5, 1.2e-4, 2.2e-4)
)
BRANCHES = (Branch(0.0025, 10.0), Branch(0.0035, 100.0), Branch(0.001, 0.5))
REAL = replace(PLAIN, resistance=OHM, entropy=ENTROPY, branches=BRANCHES)


def table_at(table, temperature_K, soc):
    """Bilinear by hand, edges held: interpolate each row over soc, then the rows."""
    column = [np.interp(soc, table.soc, row) for row in table.ohm]
    return np.interp(temperature_K, table.temperature_K, column)


def equations(cell, x, u, cooling_W):
    """Design page 1 with R0(Tc, s), E(s) and the branches, every symbol as printed there."""
    s, tc, ts, tinf, *volts = x
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    cinf = cell.coolant_heat_capacity_J_per_K
    r0, e = table_at(OHM, tc, s), np.interp(s, ENTROPY.soc, ENTROPY.V_per_K)
    heat_W = r0 * u**2 - e * tc * u
    heat_W += sum(v**2 / b.resistance_ohm for v, b in zip(volts, cell.branches))
    return [
        -u / (cell.capacity_Ah * 3600),
        -(tc - ts) / (rc * cc) + heat_W / cc,
        -(ts - tc) / (rc * cs) - (ts - tinf) / (rs * cs),
        -(tinf - ts) / (rs * cinf) - cooling_W / cinf,
        *(-(v + b.resistance_ohm * u) / b.time_constant_s for v, b in zip(volts, cell.branches)),
    ]


def test_tables_and_branches_agree_with_a_tight_integrator_to_a_microkelvin():
    state, volts = CellState(0.25, 286.0, 287.0, 283.0), (0.02, -0.01, 0.0)
    expected = np.array([*state, *volts])
    for current_A in (-23.0, -23.0, 0.0, -12.0, 5.0, -20.0):
        for _ in range(2000):
            state = integrate_step(REAL, state, current_A, 1.0, STEP_S, polarisation_V=volts)
            volts = polarisation_after_V(REAL, volts, current_A, STEP_S)
        # Short pieces, because the tables have kinks that no step should straddle for long.
        for _ in range(40):
            expected = solve_ivp(
                lambda t, x, u=current_A: equations(REAL, x, u, 1.0),
                (0.0, 0.5),
                expected,
                method="DOP853",
                rtol=1e-11,
                atol=1e-12,
            ).y[:, -1]
    assert state.core_temperature_K > 288.15, "no point of the table was passed"
    assert state.soc > 0.4
    assert np.max(np.abs(np.array([*state, *volts]) - expected)) < 1e-6


def test_a_charger_pays_for_heat_and_for_what_the_branches_store():
    """Energy into resistance and branches equals their heat plus the rise of C V^2 / 2."""
    cell = replace(REAL, entropy=None, entropic_coefficient_V_per_K=0.0)
    state, volts, current_A = CellState(0.3, 300.0, 300.0, 300.0), (0.0, 0.05, -0.02), -20.0

    def stored_J(volts):
        return sum(
            0.5 * b.time_constant_s / b.resistance_ohm * v**2 for b, v in zip(BRANCHES, volts)
        )

    begin_J, paid_J, heat_J, stored_before_J = 0.0, 0.0, 0.0, stored_J(volts)
    capacities = [
        cell.core_heat_capacity_J_per_K,
        cell.surface_heat_capacity_J_per_K,
        cell.coolant_heat_capacity_J_per_K,
    ]
    begin_J = np.dot(capacities, state[1:])
    for _ in range(3000):

        def over_V(state, volts):
            voltage_V = terminal_voltage_V(cell, state.soc, current_A, state[1], volts)
            return float(voltage_V - cell.ocv(state.soc))

        before_V = over_V(state, volts)
        state = integrate_step(cell, state, current_A, 0.0, STEP_S, polarisation_V=volts)
        volts = polarisation_after_V(cell, volts, current_A, STEP_S)
        paid_J += -current_A * 0.5 * (before_V + over_V(state, volts)) * STEP_S
    heat_J = np.dot(capacities, state[1:]) - begin_J
    assert paid_J > 100.0
    assert paid_J == pytest.approx(heat_J + stored_J(volts) - stored_before_J, rel=1e-6)


def test_constants_are_the_special_case_bit_by_bit():
    random = np.random.default_rng(4)
    one_point = replace(
        PLAIN,
        resistance=ResistanceTable((300.0,), (0.5,), ((PLAIN.ohmic_resistance_ohm,),)),
        entropy=EntropyTable((0.5,), (PLAIN.entropic_coefficient_V_per_K,)),
    )
    for _ in range(200):
        soc, u = random.uniform(0, 1), random.uniform(-25, 1)
        tc, ts, tinf = random.uniform(260.0, 330.0, 3).tolist()
        rc, cc = PLAIN.core_resistance_K_per_W, PLAIN.core_heat_capacity_J_per_K
        heat_W = (PLAIN.ohmic_resistance_ohm * u - PLAIN.entropic_coefficient_V_per_K * tc) * u
        core = 0.0 + (heat_W - (tc - ts) / rc) / cc
        state = CellState(soc, tc, ts, tinf)
        assert rates(PLAIN, state, u, 1.0).core_temperature_K == core
        assert rates(one_point, state, u, 1.0) == rates(PLAIN, state, u, 1.0)
        assert terminal_voltage_V(one_point, soc, u, tc) == terminal_voltage_V(PLAIN, soc, u)


@pytest.mark.parametrize(
    "table", [OHM, replace(OHM, soc=(0.5,), ohm=((0.02,), (0.016,), (0.01,), (0.011,), (0.01,)))]
)
def test_a_resistance_is_the_same_alone_and_in_an_array_bit_by_bit(table):
    random = np.random.default_rng(1)
    temperatures_K = [*random.uniform(270.0, 330.0, 300), *OHM.temperature_K, 278.15 - 1e-9, 400.0]
    charges = [*random.uniform(-0.1, 1.1, 300), 0.0, 0.3, 1.0, 1.0 + 1e-12, -0.0, 0.5, 2.0]
    together = table(np.array(temperatures_K), np.array(charges))
    alone = [table(float(t), float(s)) for t, s in zip(temperatures_K, charges, strict=True)]
    assert together.tolist() == alone
    assert alone == pytest.approx([table_at(table, t, s) for t, s in zip(temperatures_K, charges)])
    assert np.isnan(table(np.nan, 0.5))


@pytest.mark.parametrize("table", [ENTROPY, EntropyTable((0.5,), (1e-4,))])
def test_an_entropic_coefficient_is_the_same_alone_and_in_an_array_bit_by_bit(table):
    charges = [*np.random.default_rng(2).uniform(-0.1, 1.1, 300), *ENTROPY.soc, -0.0, 2.0]
    assert table(np.array(charges)).tolist() == [table(float(soc)) for soc in charges]


def test_many_cells_at_once_give_what_each_gives_alone():
    currents_A, socs = np.array([-23.0, -5.0, 0.0]), np.array([0.05, 0.5, 0.95])
    state = CellState(socs, np.linspace(280, 320, 3), np.full(3, 295.0), np.full(3, 293.0))
    volts = tuple(np.array([0.01, 0.02, -0.01]) for _ in BRANCHES)
    together = integrate_step(REAL, state, currents_A, 1.0, 0.1, polarisation_V=volts)
    after = polarisation_after_V(REAL, volts, currents_A, 0.1)
    for i in range(3):
        own = tuple(float(v[i]) for v in volts)
        one = CellState(*(float(x[i]) for x in state))
        current_A = float(currents_A[i])
        alone = integrate_step(REAL, one, current_A, 1.0, 0.1, polarisation_V=own)
        assert [column[i] for column in together] == pytest.approx(list(alone), rel=1e-15)
        assert [v[i] for v in after] == list(polarisation_after_V(REAL, own, current_A, 0.1))


def test_polarisation_raises_the_voltage_while_charging_and_relaxes_to_none():
    volts = at_rest_V(REAL)
    assert volts == (0.0, 0.0, 0.0)
    charged = polarisation_after_V(REAL, volts, -10.0, 5000.0)
    assert charged == pytest.approx([0.025, 0.035, 0.01])
    rested = polarisation_after_V(REAL, charged, 0.0, 100.0)
    assert rested == pytest.approx([0.025 * np.exp(-10), 0.035 * np.exp(-1), 0.0], abs=1e-12)
    for current_A, temperature_K, soc in itertools.product(
        (-20.0, 0.0, 3.0), (285.0, 310.0), (0.2, 0.9)
    ):
        voltage_V = terminal_voltage_V(REAL, soc, current_A, temperature_K, charged)
        by_hand_V = float(REAL.ocv(soc)) - current_A * table_at(OHM, temperature_K, soc) + 0.07
        assert voltage_V == pytest.approx(by_hand_V, abs=1e-12)


def test_the_voltage_of_an_overfull_cell_rises_by_the_slope():
    ocv = replace(PLAIN.ocv, overfill_slope_V=15.0)
    cell = replace(PLAIN, ocv=ocv)
    full_V = terminal_voltage_V(cell, 1.0, 0.0)
    assert terminal_voltage_V(cell, 1.004, 0.0) - full_V == pytest.approx(0.06)
    assert terminal_voltage_V(cell, 0.996, 0.0) < full_V


FACTOR_OF = {
    "core_resistance": "core_resistance_K_per_W",
    "core_heat_capacity": "core_heat_capacity_J_per_K",
    "surface_resistance": "surface_resistance_K_per_W",
    "surface_heat_capacity": "surface_heat_capacity_J_per_K",
    "coolant_heat_capacity": "coolant_heat_capacity_J_per_K",
    "capacity": "capacity_Ah",
}


@pytest.mark.parametrize(("factor", "parameter"), FACTOR_OF.items())
def test_a_factor_scales_its_parameter_and_nothing_else(factor, parameter):
    other = scaled(REAL, CellFactors(**{factor: 1.25}))
    assert getattr(other, parameter) == 1.25 * getattr(REAL, parameter)
    assert replace(other, **{parameter: getattr(REAL, parameter)}) == REAL


def test_factors_of_one_leave_the_cell_as_it_is():
    assert scaled(REAL, CellFactors()) == REAL
    assert all(field.default in (0.0, 1.0) for field in fields(CellFactors))


def test_resistance_polarisation_entropy_and_voltage_of_another_cell():
    factors = CellFactors(
        resistance=2.0,
        polarisation=0.5,
        relaxation=1.5,
        entropic_error_V_per_K=1e-5,
        ocv_error_V=-0.01,
    )
    other = scaled(REAL, factors)
    for temperature_K, soc in itertools.product((270.0, 293.0, 340.0), (0.0, 0.2, 1.0)):
        assert other.resistance(temperature_K, soc) == pytest.approx(2 * OHM(temperature_K, soc))
        assert other.entropy(soc) == pytest.approx(ENTROPY(soc) + 1e-5)
        assert other.ocv(soc) == pytest.approx(REAL.ocv(soc) - 0.01)
    assert other.ohmic_resistance_ohm == 2 * REAL.ohmic_resistance_ohm
    assert other.entropic_coefficient_V_per_K == REAL.entropic_coefficient_V_per_K + 1e-5
    assert [b.resistance_ohm for b in other.branches] == [0.00125, 0.00175, 0.0005]
    assert [b.time_constant_s for b in other.branches] == [15.0, 150.0, 0.75]
    assert scaled(REAL, CellFactors(polarisation=0.0)).branches == ()
    disturbed = rates(
        other, CellState(0.3, 300.0, 300.0, 300.0), -10.0, 0.0, Disturbance(1, 2, 3, 4)
    )
    assert disturbed.coolant_temperature_K == 4
