"""The C plant's step: against the Runge-Kutta step of bms.cell, and against an exact integrator."""

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
from bms.presets import load_preset
from hil_sim.native._native import ffi, lib
from hil_sim.native.cell_fields import cell_fields

STEP_S = 0.01
PLAIN = load_preset("lin2014").cell
REAL = replace(
    PLAIN,
    ocv=replace(PLAIN.ocv, overfill_slope_V=15.0),
    resistance=ResistanceTable(
        (278.15, 288.15, 298.15, 308.15, 318.15),
        (0.0, 0.3, 1.0),
        (
            (0.0241, 0.0230, 0.0260),
            (0.0163, 0.0150, 0.0180),
            (0.0110, 0.0099, 0.0120),
            (0.0114, 0.0105, 0.0109),
            (0.0102, 0.0100, 0.0104),
        ),
    ),
    entropy=EntropyTable((0.0, 0.1, 0.4, 0.7, 1.0), (-3.6e-4, -4.6e-4, -5.1e-5, 1.2e-4, 2.2e-4)),
    branches=(Branch(0.0025, 10.0), Branch(0.0035, 100.0), Branch(0.001, 0.5)),
)


class CellInC:
    def __init__(self, cell, state, volts=()):
        self.cell = ffi.new("cell_t *", cell_fields(cell, STEP_S))
        self.memory = ffi.new("cell_memory_t *", {"state": tuple(state), "polarisation_V": volts})

    def step(self, current_A, cooling_W, before, after):
        ends = ffi.new("cell_state_t *", tuple(before)), ffi.new("cell_state_t *", tuple(after))
        lib.cell_step(self.cell, self.memory, current_A, cooling_W, *ends)

    @property
    def state(self):
        now = self.memory.state
        return CellState(now.soc, now.core, now.surface, now.coolant)

    def voltage_V(self, current_A):
        return lib.cell_terminal_voltage_V(self.cell, self.memory, current_A)


def charge_both(cell, volts, seconds, seed=3):
    """The same random currents and disturbances for both plants; largest differences."""
    random = np.random.default_rng(seed)
    state, worst = CellState(0.15, 286.0, 287.0, 283.0), np.zeros(3)
    ours = CellInC(cell, state, volts)
    before, current_A = Disturbance(0.0, 0.0, 0.0, 0.0), 0.0
    for step in range(round(seconds / STEP_S)):
        if step % 1000 == 0:
            current_A = float(random.choice([-23.0, -20.0, -12.0, 0.0]))
        after = Disturbance(*(random.uniform(-1, 1, 4) * [1e-7, 1e-2, 1e-2, 1e-2]).tolist())
        state = integrate_step(
            cell, state, current_A, 1.5, STEP_S, before, after, polarisation_V=volts
        )
        volts = polarisation_after_V(cell, volts, current_A, STEP_S)
        ours.step(current_A, 1.5, before, after)
        before = after
        python_V = terminal_voltage_V(cell, state.soc, current_A, state.core_temperature_K, volts)
        differences = np.abs(np.array(ours.state) - state)
        difference_V = abs(ours.voltage_V(current_A) - python_V)
        worst = np.maximum(worst, [differences[0], differences[1:].max(), difference_V])
    return state, worst


def test_a_cell_of_constants_agrees_with_runge_kutta_to_a_nanokelvin():
    state, worst = charge_both(PLAIN, (), 100.0)
    assert state.core_temperature_K > 286.0
    assert np.all(worst < [1e-13, 2e-9, 1e-12]), worst


def test_a_real_cell_agrees_with_runge_kutta_to_a_microkelvin():
    state, worst = charge_both(REAL, (0.01, -0.01, 0.0), 100.0)
    assert state.core_temperature_K > 288.15
    assert np.all(worst < [1e-13, 1e-6, 1e-9]), worst


def test_the_thermal_step_is_exact_for_heat_that_is_constant():
    """Steps of a minute, far beyond what a Runge-Kutta step of the cell could do."""
    cell = replace(PLAIN, entropic_coefficient_V_per_K=0.0)
    start, step_s, current_A, cooling_W = [300.0, 295.0, 290.0], 60.0, -20.0, 2.0
    ours = CellInC(cell, CellState(0.1, *start))
    ours.cell = ffi.new("cell_t *", cell_fields(cell, step_s))
    before, after = (0.0, 0.02, -0.01, 0.005), (0.0, -0.01, 0.03, 0.0)
    ours.step(current_A, cooling_W, before, after)

    def right_side(t, x):
        tc, ts, tinf = x
        nu = [a + (b - a) * t / step_s for a, b in zip(before, after)]
        inner_W = (tc - ts) / cell.core_resistance_K_per_W
        outer_W = (ts - tinf) / cell.surface_resistance_K_per_W
        heat_W = cell.ohmic_resistance_ohm * current_A**2
        return [
            (heat_W - inner_W) / cell.core_heat_capacity_J_per_K + nu[1],
            (inner_W - outer_W) / cell.surface_heat_capacity_J_per_K + nu[2],
            (outer_W - cooling_W) / cell.coolant_heat_capacity_J_per_K + nu[3],
        ]

    expected = solve_ivp(right_side, (0, step_s), start, method="DOP853", rtol=1e-12, atol=1e-12)
    assert list(ours.state[1:]) == pytest.approx(expected.y[:, -1].tolist(), abs=1e-9)


@pytest.mark.parametrize("soc", [-0.1, 0.0, 0.2999, 0.3, 0.99, 1.0, 1.004])
@pytest.mark.parametrize("core_K", [270.0, 278.15, 293.0, 318.15, 330.0])
def test_the_voltage_is_that_of_the_cell_model(soc, core_K):
    volts = (0.01, 0.02, -0.005)
    ours = CellInC(REAL, CellState(soc, core_K, 300.0, 300.0), volts)
    assert ours.voltage_V(-17.0) == terminal_voltage_V(REAL, soc, -17.0, core_K, volts)
