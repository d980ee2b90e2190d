"""Cyclers' files of cells that are not the project's model: layers, charge transfer, hysteresis.

Heat is conducted through ten layers and a case instead of between two masses. Resistances follow
state of charge, temperature and current, each in its own way; the open-circuit voltage lags behind
a change of the current's sign. Temperatures of every layer are known, so the hottest one is too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from bms.arrays import Array

LAYERS = 10
GAS_J_PER_MOL_K, FARADAY_C_PER_MOL = 8.314, 96485.0


@dataclass(frozen=True)
class ForeignCell:
    """A cell by its sheet and its physics; lengths in mm, resistances at 298.15 K."""

    name: str
    geometry: str
    capacity_Ah: float
    full_V: float
    empty_V: float
    charge_A: float
    ocv_soc: tuple[float, ...]
    ocv_V: tuple[float, ...]
    hysteresis_V: float
    entropy_V_per_K: tuple[float, ...]
    ohm: float
    transfer_ohm: float
    branches: tuple[tuple[float, float], ...]
    sizes_mm: tuple[float, ...]
    conductivity_W_per_mK: float
    air_W_per_m2K: float
    heat_J_per_m3K: float = 2.1e6
    case_share: float = 0.06
    activation_K: float = 2800.0

    @property
    def rated(self) -> tuple[str, ...]:
        """What the sheet says, as options of the command."""
        return (
            "--geometry", self.geometry, "--rated", f"max_charge_A={self.charge_A:g}",
            "--rated", f"max_voltage_V={self.full_V:g}",
            "--rated", "charge_temperature_degC=0..45",
        )  # fmt: skip


NMC_21700 = ForeignCell(
    "nmc_21700", "21700", 5.0, 4.2, 2.6, 5.0,
    (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0),
    (2.6, 2.98, 3.15, 3.32, 3.47, 3.55, 3.61, 3.68, 3.79, 3.89, 3.99, 4.07, 4.11, 4.19),
    0.004, (-2.5e-4, -1e-4, 2e-5, -3e-5, -8e-5, -6e-5),
    0.016, 0.007, ((0.004, 12.0), (0.006, 90.0), (0.005, 700.0)),
    (21.0, 70.0), 0.55, 18.0,
)  # fmt: skip
LFP_PRISMATIC = ForeignCell(
    "lfp_prismatic", "prismatic:148x27x93", 40.0, 3.65, 2.5, 40.0,
    (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.96, 0.99, 1.0),
    (2.55, 2.9, 3.08, 3.19, 3.24, 3.275, 3.285, 3.29, 3.3, 3.325, 3.33, 3.333, 3.34, 3.4, 3.52),
    0.008, (-4e-4, -1e-4, 1e-4, 5e-5, -5e-5, 1e-4),
    0.0011, 0.0006, ((0.0003, 15.0), (0.0005, 120.0), (0.0004, 900.0)),
    (148.0, 27.0, 93.0), 0.8, 20.0,
)  # fmt: skip
LTO_18650 = ForeignCell(
    "lto_18650", "18650", 2.0, 2.8, 1.5, 8.0,
    (0.0, 0.03, 0.08, 0.15, 0.3, 0.45, 0.6, 0.75, 0.88, 0.95, 1.0),
    (1.6, 1.95, 2.08, 2.15, 2.2, 2.25, 2.31, 2.39, 2.48, 2.57, 2.75),
    0.003, (-1e-4, 5e-5, 8e-5, 3e-5, 1e-5, 5e-5),
    0.010, 0.004, ((0.002, 8.0), (0.003, 60.0), (0.002, 500.0)),
    (18.0, 65.0), 0.35, 25.0,
)  # fmt: skip
CELLS = {cell.name: cell for cell in (NMC_21700, LFP_PRISMATIC, LTO_18650)}


class Layers:
    """Temperatures (LAYERS + 1,) from the hottest place to the case, heat made evenly inside."""

    def __init__(self, cell: ForeignCell, ambient_K: float, step_s: float) -> None:
        size_m = [1e-3 * side for side in cell.sizes_mm]
        if len(size_m) == 2:
            radius_m, length_m = 0.5 * size_m[0], size_m[1]
            edges_m = np.linspace(0.0, radius_m, LAYERS + 1)
            volumes_m3 = math.pi * length_m * np.diff(edges_m**2)
            areas_m2 = 2.0 * math.pi * length_m * edges_m[1:]
            outside_m2 = 2.0 * math.pi * radius_m * (length_m + radius_m)
        else:
            thickness_m, *face_m = sorted(size_m)
            face_m2 = 2.0 * face_m[0] * face_m[1]
            edges_m = np.linspace(0.0, 0.5 * thickness_m, LAYERS + 1)
            volumes_m3 = face_m2 * np.diff(edges_m)
            areas_m2 = np.full(LAYERS, face_m2)
            outside_m2 = face_m2 + 2.0 * thickness_m * sum(face_m)
        inside = cell.heat_J_per_m3K * volumes_m3
        self.capacity_J_per_K = np.append(
            (1.0 - cell.case_share) * inside, cell.case_share * inside.sum()
        )
        pitch_m = float(edges_m[1])
        flows = cell.conductivity_W_per_mK * areas_m2 / pitch_m
        flows[-1] *= 2.0
        matrix = np.zeros((LAYERS + 2, LAYERS + 2))
        for row, flow in enumerate(flows):
            for one, other in ((row, row + 1), (row + 1, row)):
                matrix[one, one] -= flow / self.capacity_J_per_K[one]
                matrix[one, other] += flow / self.capacity_J_per_K[one]
        out = cell.air_W_per_m2K * outside_m2 / self.capacity_J_per_K[LAYERS]
        matrix[LAYERS, LAYERS] -= out
        matrix[:LAYERS, LAYERS + 1] = volumes_m3 / volumes_m3.sum()
        matrix[:LAYERS, LAYERS + 1] /= self.capacity_J_per_K[:LAYERS]
        self._step, self._ambient_K = expm(matrix * step_s), ambient_K
        self.above_K = np.zeros(LAYERS + 1)

    def warm(self, heat_W: float) -> None:
        """One step with a heat in W."""
        self.above_K = (self._step @ np.append(self.above_K, heat_W))[:-1]

    @property
    def core_K(self) -> float:
        """The innermost layer."""
        return float(self._ambient_K + self.above_K[0])

    @property
    def mean_K(self) -> float:
        """By which resistances and reactions go."""
        return float(self._ambient_K + self.above_K[:LAYERS].mean())

    @property
    def surface_K(self) -> float:
        """Of the case."""
        return float(self._ambient_K + self.above_K[LAYERS])


@dataclass(frozen=True)
class Played:
    """A recording with what no cycler sees: time, current (discharge positive), voltage, K."""

    time_s: Array
    current_A: Array
    voltage_V: Array
    surface_K: Array
    ambient_K: Array
    core_K: Array


def play(
    cell: ForeignCell,
    stages: list[tuple[float, float]],
    soc: float,
    *,
    step_s: float = 1.0,
    ambient_K: float = 296.0,
    drift_K: float = 0.0,
    extra_W: float = 0.0,
) -> Played:
    """Stages of a current in A and a time in s, each ended by the cell's voltages too.

    The ambient swings by `drift_K` within two hours, and the cell with it; what else warms the
    cell, such as a neighbour, by `extra_W`.
    """
    layers = Layers(cell, ambient_K, step_s)
    direction, lag_V = 1.0, [0.0] * len(cell.branches)
    rows = [(0.0, 0.0, _ocv_V(cell, soc, 1.0), layers.surface_K, ambient_K, layers.core_K)]
    time_s = 0.0
    for current_A, length_s in stages:
        for _ in range(round(length_s / step_s)):
            mean_K = layers.mean_K
            growth = math.exp(cell.activation_K * (1.0 / mean_K - 1.0 / 298.15))
            soc -= current_A * step_s / (3600.0 * cell.capacity_Ah)
            moved = abs(current_A) * step_s / (3600.0 * cell.capacity_Ah)
            sign = math.copysign(1.0, current_A) if current_A else direction
            direction += (sign - direction) * (1.0 - math.exp(-moved / 0.03))
            shape = 1.0 + 0.6 * math.exp(-soc / 0.06)
            thermal_V = 2.0 * GAS_J_PER_MOL_K * mean_K / FARADAY_C_PER_MOL
            exchange_A = thermal_V / (cell.transfer_ohm * growth**1.3 * shape)
            transfer_V = thermal_V * math.asinh(0.5 * current_A / exchange_A) * 2.0
            for place, (ohm, lasts_s) in enumerate(cell.branches):
                towards_V = ohm * growth**0.7 * shape * current_A
                lag_V[place] += (towards_V - lag_V[place]) * (1.0 - math.exp(-step_s / lasts_s))
            over_V = cell.ohm * growth**0.5 * current_A + transfer_V + sum(lag_V)
            ocv_V = _ocv_V(cell, soc, direction)
            entropy = float(
                np.interp(
                    soc, np.linspace(0.0, 1.0, len(cell.entropy_V_per_K)), cell.entropy_V_per_K
                )
            )
            time_s += step_s
            swing = math.sin(2.0 * math.pi * time_s / 7200.0)
            layers.warm(current_A * over_V - current_A * mean_K * entropy + extra_W * swing)
            voltage_V = ocv_V - over_V
            rows.append(
                (time_s, current_A, voltage_V, layers.surface_K + drift_K * swing,
                 ambient_K + drift_K * swing, layers.core_K + drift_K * swing)
            )  # fmt: skip
            is_empty = current_A > 0 and (voltage_V < cell.empty_V or soc <= 0.0)
            if is_empty or (current_A < 0 and voltage_V > cell.full_V):
                break
    return Played(*np.array(rows).T)


def _ocv_V(cell: ForeignCell, soc: float, direction: float) -> float:
    return float(np.interp(soc, cell.ocv_soc, cell.ocv_V)) - cell.hysteresis_V * direction


def campaign(cell: ForeignCell, seed: int = 0, extra_W: float = 0.0) -> dict[str, Played]:
    """Discharges at C/10, 1C and 2C, pulses from full to empty, and an unused one at 1.5C."""
    hour_A, shift_s = cell.capacity_Ah, 137.0 * seed
    pulses = [(0.0, 60.0)]
    for _ in range(9):
        pulses += [(2.0 * hour_A, 15.0), (0.0, 200.0), (-0.8 * hour_A, 15.0), (0.0, 200.0)]
        pulses += [(hour_A, 360.0), (0.0, 1800.0)]
    swings = {"drift_K": 0.2, "extra_W": extra_W}
    slowly = [(0.0, 60.0 + shift_s), (0.1 * hour_A, 4e4)]
    return {
        "slow": play(cell, slowly, 1.0, step_s=20.0, **swings),
        "one": play(cell, [(0.0, 30.0 + shift_s), (hour_A, 4e3)], 1.0, step_s=1.0, **swings),
        "two": play(cell, [(0.0, 30.0 + shift_s), (2.0 * hour_A, 2e3)], 1.0, **swings),
        "pulses": play(cell, pulses, 1.0, **swings),
        "unused": play(cell, [(0.0, 30.0 + shift_s), (1.5 * hour_A, 3e3)], 1.0, **swings),
    }  # fmt: skip


def write(path: Path, played: Played, seed: int, *, comma: bool = False) -> Path:
    """Time s, current A (discharge negative), V, surface and ambient degC, noisy and rounded.

    With `comma` a decimal comma, semicolons and two lines of a header, as German cyclers write.
    """
    rng, count = np.random.default_rng(seed), len(played.time_s)
    strongest_A = float(np.max(np.abs(played.current_A)))
    table = np.column_stack([
        played.time_s,
        -played.current_A + rng.normal(0.0, 2e-4 * strongest_A, count),
        played.voltage_V + rng.normal(0.0, 5e-4, count),
        played.surface_K - 273.15 + rng.normal(0.0, 0.03, count),
        played.ambient_K - 273.15 + rng.normal(0.0, 0.03, count),
    ])  # fmt: skip
    lines = [";".join(f"{value:.5f}" for value in row) for row in table]
    text = "\n".join(lines) + "\n"
    if comma:
        text = "Prüfstand 3\nt;I;U;T1;T2\n" + text.replace(".", ",")
    path.write_text(text, encoding="utf-8")
    return path


COLUMNS = (
    "--columns", "time=0,current=1,voltage=2,surface=3,ambient=4",
    "--temperature-unit", "degC", "--charge-positive",
)  # fmt: skip
