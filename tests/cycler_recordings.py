"""Recordings as a cycler writes them, of a cell that is the project's own model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from bms.cell import CellParameters, CellState, integrate_step, terminal_voltage_V

ZERO_CELSIUS_K = 273.15
AMBIENT_K = 298.15


def write_cycler(
    path: Path, cell: CellParameters, current_A: Callable[[float], float], step_s: float, seed: int
) -> Path:
    """A discharge from full: time s, current A (discharge negative), V, surface and ambient degC.

    `current_A` is positive while discharging, over the time; the recording ends when the cell is
    empty. Sensors have a noise of 1 mV and 20 mK.
    """
    rng = np.random.default_rng(seed)
    state, time_s, rows = CellState(1.0, AMBIENT_K, AMBIENT_K, AMBIENT_K), 0.0, []
    while state.soc > 0.0:
        drawn_A = current_A(time_s)
        voltage_V = (
            float(terminal_voltage_V(cell, state.soc, drawn_A)) + 1e-3 * rng.standard_normal()
        )
        surface_K = state.surface_temperature_K + 0.02 * rng.standard_normal()
        rows.append((time_s, -drawn_A, voltage_V, surface_K - ZERO_CELSIUS_K, 25.0))
        parts = max(round(step_s / 0.5), 1)
        for _ in range(parts):
            state = integrate_step(cell, state, drawn_A, 0.0, step_s / parts)
            state = state._replace(coolant_temperature_K=AMBIENT_K)
        time_s += step_s
    np.savetxt(path, np.array(rows), delimiter=",", fmt="%.5f")
    return path
