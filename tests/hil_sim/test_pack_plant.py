"""The plant of coupled cells, beside an integrator that knows nothing of it."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bms.cell import CellFactors, CellState, Disturbance, rates, scaled
from bms.presets import load_preset
from hil_sim.native.cell_fields import cell_fields
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import PackCharge, all_cells
from hil_sim.studies.pack.spread import PackDraw, Surroundings
from tests.hil_sim.pack_rig import core_of

PRESET = load_preset("paper_calibrated")
AROUND = Surroundings(neighbour_W_per_K=0.3, flow_W_per_K=5.0)
FACTORS = (
    CellFactors(core_resistance=1.1, resistance=0.8, capacity=1.1),
    CellFactors(surface_resistance=0.9, resistance=1.2),
    CellFactors(core_heat_capacity=0.8),
)
NU = Disturbance(0.0, 4e-3, -2e-3, 1e-3)
COOLING_W = 0.8


def plant_of(factors, states, around=AROUND):
    cells = tuple(scaled(PRESET.cell, factor) for factor in factors)
    draw = PackDraw(cells, tuple(states), (NU,) * len(cells))
    charge = PackCharge(core_of("paper_calibrated"), draw, around, all_cells(len(cells)), 3600.0)
    charge.fields.plant.cooling_power_W = COOLING_W
    return charge, cells


def coupled(_, x, cells, current_A):
    """Rates of all cells, (4 n,), from the equations of one and what they do to each other."""
    states = x.reshape(-1, 4)
    inlet_K = states[-1, 3] - len(cells) * COOLING_W / AROUND.flow_W_per_K
    out = np.empty_like(states)
    for i, cell in enumerate(cells):
        own = np.array(rates(cell, CellState(*states[i]), current_A, 0.0, NU))
        for j in (i - 1, i + 1):
            if 0 <= j < len(cells):
                flow_W = AROUND.neighbour_W_per_K * (states[j, 2] - states[i, 2])
                own[2] += flow_W / cell.surface_heat_capacity_J_per_K
        before_K = inlet_K if i == 0 else states[i - 1, 3]
        flow_W = AROUND.flow_W_per_K * (before_K - states[i, 3])
        own[3] += flow_W / cell.coolant_heat_capacity_J_per_K
        out[i] = own
    return out.ravel()


def test_coupled_cells_go_as_the_integrator_says():
    starts = [CellState(0.1, 300.0, 299.0, 298.0 + i) for i in range(3)]
    charge, cells = plant_of(FACTORS, starts)
    plant, x = ffi.addressof(charge.fields, "plant"), np.ravel(starts)
    for current_A, periods in ((-20.0, 600), (0.0, 100), (-8.0, 900)):
        span = (0.0, 0.1 * periods)
        x = solve_ivp(coupled, span, x, "LSODA", args=(cells, current_A), rtol=1e-9, atol=1e-9).y[
            :, -1
        ]
        lib.plant_hold(plant, current_A, 10 * periods)
        seen = [plant.cell[i].memory.state for i in range(3)]
        flat = [v for s in seen for v in (s.soc, s.core, s.surface, s.coolant)]
        assert flat == pytest.approx(x.tolist(), abs=1e-4)
    assert plant.cell[2].memory.state.core - plant.cell[0].memory.state.core > 0.5


def test_one_cell_is_the_cell_of_lock_step():
    start = CellState(0.2, 300.0, 299.0, 297.0)
    charge, (cell,) = plant_of(FACTORS[:1], [start])
    plant = ffi.addressof(charge.fields, "plant")
    other = ffi.new("cell_t *", cell_fields(cell, 0.01))
    memory = ffi.new("cell_memory_t *", {"state": tuple(start)})
    knot = ffi.new("cell_state_t *", tuple(NU))
    knots = ffi.new("double[]", list(NU) * 10)
    peaks = ffi.new("cell_peaks_t *")
    for current_A in (-20.0, -5.0, 0.0):
        for _ in range(50):
            lib.plant_hold(plant, current_A, 10)
            lib.cell_hold(
                other, memory, current_A, COOLING_W, 1.0, knot, knots, 10, peaks, ffi.NULL, ffi.NULL
            )
    own, lone = plant.cell[0].memory.state, memory.state
    for name in ("soc", "core", "surface", "coolant"):
        assert getattr(own, name) == getattr(lone, name)
    assert plant.cell[0].peaks.core_temperature_K == peaks.core_temperature_K
    assert plant.cell[0].peaks.voltage_V == pytest.approx(peaks.voltage_V, abs=1e-12)
