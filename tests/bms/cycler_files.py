"""Recordings of a known cell in the manner of a cycler: the truth that identification must hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bms.cell import (
    Branch,
    CellParameters,
    CellState,
    EntropyTable,
    OpenCircuitVoltage,
    ResistanceTable,
    at_rest_V,
    integrate_step,
    polarisation_after_V,
    terminal_voltage_V,
)

AMBIENT_K = 296.0
_SOC = (0.0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0)

TRUTH = CellParameters(
    capacity_Ah=5.0,
    core_resistance_K_per_W=2.0,
    core_heat_capacity_J_per_K=62.0,
    surface_resistance_K_per_W=9.0,
    surface_heat_capacity_J_per_K=5.0,
    coolant_heat_capacity_J_per_K=1e9,
    ohmic_resistance_ohm=0.018,
    entropic_coefficient_V_per_K=-1e-5,
    ocv=OpenCircuitVoltage(_SOC, (2.7, 3.1, 3.38, 3.5, 3.6, 3.69, 3.83, 3.98, 4.07, 4.18)),
    resistance=ResistanceTable((278.15, 298.15, 318.15), (0.0,), ((0.030,), (0.018,), (0.0125,))),
    branches=(Branch(0.006, 15.0), Branch(0.008, 120.0)),
    entropy=EntropyTable((0.0, 0.5, 1.0), (-1e-4, 5e-5, -2e-5)),
)
"""A 21700 of 5 Ah; its surroundings stay as they are."""


def recording(
    stages: list[tuple[float, float]], soc: float, seed: int, step_s: float = 1.0
) -> np.ndarray:
    """Rows of time, current (discharge negative), voltage, surface and ambient in degC.

    A stage is a current in A (positive: discharge) and a time in s; it ends at 2.7 or 4.18 V too.
    Sensor noise of 1 mA, 0.5 mV and 20 mK.
    """
    rng = np.random.default_rng(seed)
    state = CellState(soc, AMBIENT_K, AMBIENT_K, AMBIENT_K)
    polarisation_V = at_rest_V(TRUTH)
    rows = [(0.0, 0.0, float(TRUTH.ocv(soc)), AMBIENT_K)]
    time_s = 0.0
    for current_A, duration_s in stages:
        for _ in range(round(duration_s / step_s)):
            state = integrate_step(
                TRUTH, state, current_A, 0.0, step_s, polarisation_V=polarisation_V
            )
            polarisation_V = polarisation_after_V(TRUTH, polarisation_V, current_A, step_s)
            time_s += step_s
            voltage_V = float(
                terminal_voltage_V(TRUTH, state[0], current_A, state[1], polarisation_V)
            )
            rows.append((time_s, -current_A, voltage_V, float(state[2])))
            if (current_A > 0 and voltage_V < 2.7) or (current_A < 0 and voltage_V > 4.18):
                break
    found = np.array(rows)
    found[:, 1] += rng.normal(0.0, 1e-3, len(found))
    found[:, 2] += rng.normal(0.0, 5e-4, len(found))
    found[:, 3] += rng.normal(0.0, 0.02, len(found)) - 273.15
    ambient = np.full(len(found), AMBIENT_K - 273.15)
    return np.column_stack([found, ambient])


def write(path: Path, rows: np.ndarray) -> Path:
    """The rows as a file with a mark and without a header."""
    lines = [",".join(f"{value:.6g}" for value in row) for row in rows]
    path.write_text("\ufeff" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def campaign(folder: Path) -> dict[str, Path]:
    """Discharges at C/10, 1C and 3C, pulses from full to empty, and an unused one at 2C."""
    pulses = [(0.0, 60.0)]
    for _ in range(9):
        pulses += [(10.0, 20.0), (0.0, 180.0), (-2.5, 20.0), (0.0, 180.0), (5.0, 360.0)]
        pulses += [(0.0, 900.0)]
    return {
        name: write(folder / f"{name}.csv", recording(stages, 1.0, seed, step_s))
        for seed, (name, stages, step_s) in enumerate(
            (
                ("slow", [(0.0, 60.0), (0.5, 40000.0)], 20.0),
                ("one", [(0.0, 30.0), (5.0, 4000.0)], 2.0),
                ("three", [(0.0, 30.0), (15.0, 1300.0)], 1.0),
                ("pulses", pulses, 2.0),
                ("unused", [(0.0, 30.0), (10.0, 2000.0)], 1.0),
            )
        )
    }
