"""A preset held against a recording that it was not made from."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.cell import CellParameters, ohmic_resistance_ohm
from bms.data.cycler import CyclerRecording
from bms.identification.alignment import curve_of, tie
from bms.identification.cell_identification import thermal_record
from bms.identification.pieces import relaxed
from bms.identification.surface_thermal import ThermalRecord, two_masses_K
from bms.presets import Preset

_MIDDLE = (0.1, 0.9)
_ROUNDS = 4


@dataclass(frozen=True)
class PresetCheck:
    """Errors of the nominal cell on a recording, and what share of it the family's band holds.

    Surface figures are None where no surface was recorded. `voltage_rmse_V` is over states of
    charge of the preset from 0.1 to 0.9.
    """

    recording: str
    rows: int
    voltage_rmse_V: float
    voltage_rmse_all_V: float
    surface_rmse_K: float | None
    voltage_covered: float
    surface_covered: float | None

    @property
    def line(self) -> str:
        """The figures in one line."""
        text = (
            f"check {self.recording}: voltage RMSE {1e3 * self.voltage_rmse_V:.1f} mV over SoC "
            f"0.1..0.9 ({1e3 * self.voltage_rmse_all_V:.1f} mV in all)"
        )
        if self.surface_rmse_K is not None:
            text += f", surface RMSE {self.surface_rmse_K:.2f} K"
        text += f"; intervals cover {100 * self.voltage_covered:.1f} % of the voltages"
        if self.surface_covered is not None:
            text += f" and {100 * self.surface_covered:.1f} % of the surface temperatures"
        return text


@dataclass(frozen=True)
class Prediction:
    """What the preset predicts of a recording from its current alone, arrays (N,)."""

    soc: Array
    voltage_V: Array
    low_V: Array
    high_V: Array
    surface_K: Array
    coldest_K: Array
    warmest_K: Array


def check_preset(preset: Preset, recording: CyclerRecording) -> PresetCheck:
    """Errors and coverage on one recording; the state of charge at its start is from its rest."""
    found = predict(preset, recording)
    error_V = found.voltage_V - recording.voltage_V
    middle = (found.soc >= _MIDDLE[0]) & (found.soc <= _MIDDLE[1])
    reading_V = preset.sensors.voltage_V.error_bound
    covered = (recording.voltage_V >= found.low_V - reading_V) & (
        recording.voltage_V <= found.high_V + reading_V
    )
    surface_rmse_K = surface_covered = None
    if recording.surface_K is not None:
        reading_K = preset.sensors.surface_temperature_K.error_bound
        surface_rmse_K = _rms(found.surface_K - recording.surface_K)
        surface_covered = float(
            np.mean(
                (recording.surface_K >= found.coldest_K - reading_K)
                & (recording.surface_K <= found.warmest_K + reading_K)
            )
        )
    return PresetCheck(
        recording.name,
        len(recording.time_s),
        _rms(error_V[middle]) if np.any(middle) else _rms(error_V),
        _rms(error_V),
        surface_rmse_K,
        float(np.mean(covered)),
        surface_covered,
    )


def predict(preset: Preset, recording: CyclerRecording) -> Prediction:
    """Nominal cell and ends of the family over a recording, from its current and ambient alone."""
    cell, interval = preset.cell, preset.cell.interval
    assert interval is not None
    soc, _ = tie(
        recording, cell.capacity_Ah, curve_of(cell.ocv.soc, cell.ocv.voltage_V), is_slow=False
    )
    record = thermal_record(recording, soc, np.zeros_like(soc))
    core_K, surface_K = record.surface_K, record.surface_K
    polarised_V, branch_W = _branches(cell, recording)
    for _ in range(_ROUNDS):
        ohmic_V = -recording.current_A * ohmic_resistance_ohm(cell, core_K, soc)
        heat = _heat_W(cell, record, -recording.current_A * ohmic_V + branch_W, core_K)
        core_K, surface_K = two_masses_K(
            cell.core_resistance_K_per_W,
            cell.core_heat_capacity_J_per_K,
            cell.surface_resistance_K_per_W,
            cell.surface_heat_capacity_J_per_K,
            record,
            heat,
        )
    out_Ah = recording.charge_out_As / 3600.0
    counted = [
        soc[0] - (out_Ah - out_Ah[0]) / (cell.capacity_Ah * share) for share in interval.capacity
    ]
    ends_V = _ends(ohmic_V, interval.resistance)
    branches_V = _ends(polarised_V, interval.polarisation)
    coldest_K, warmest_K = _surfaces(preset, record, ohmic_V, branch_W, core_K)
    return Prediction(
        soc,
        np.asarray(cell.ocv(soc) + ohmic_V + polarised_V),
        np.minimum(*(cell.ocv(s) for s in counted))
        - interval.ocv_error_V
        + ends_V[0]
        + branches_V[0],
        np.maximum(*(cell.ocv(s) for s in counted))
        + interval.ocv_error_V
        + ends_V[1]
        + branches_V[1],
        surface_K,
        coldest_K,
        warmest_K,
    )


def _branches(cell: CellParameters, recording: CyclerRecording) -> tuple[Array, Array]:
    """Voltage and heat (N,) of all branches together."""
    voltage_V, heat_W = np.zeros_like(recording.time_s), np.zeros_like(recording.time_s)
    for branch in cell.branches:
        through_A = relaxed(recording.time_s, recording.current_A, branch.time_constant_s)
        voltage_V -= branch.resistance_ohm * through_A
        heat_W += branch.resistance_ohm * through_A**2
    return voltage_V, heat_W


def _heat_W(
    cell: CellParameters, record: ThermalRecord, irreversible_W: Array, core_K: Array
) -> Array:
    coefficient = (
        cell.entropic_coefficient_V_per_K if cell.entropy is None else cell.entropy(record.soc)
    )
    return np.asarray(irreversible_W - coefficient * core_K * record.current_A)


def _surfaces(
    preset: Preset, record: ThermalRecord, ohmic_V: Array, branch_W: Array, core_K: Array
) -> tuple[Array, Array]:
    """Coldest and warmest surface (N,) over the corners of the family."""
    cell, interval = preset.cell, preset.cell.interval
    assert interval is not None
    ohmic_W = -record.current_A * ohmic_V
    error_W = interval.entropic_error_V_per_K * core_K * np.abs(record.current_A)
    heats = [
        _heat_W(cell, record, ohmic * ohmic_W + branch * branch_W, core_K) + sign * error_W
        for ohmic, branch, sign in zip(interval.resistance, interval.polarisation, (-1.0, 1.0))
    ]
    surfaces = [
        two_masses_K(
            cell.core_resistance_K_per_W * inner,
            cell.core_heat_capacity_J_per_K * core,
            cell.surface_resistance_K_per_W * outer,
            cell.surface_heat_capacity_J_per_K * surface,
            record,
            heat,
        )[1]
        for inner, core, outer, surface, heat in itertools.product(
            interval.core_resistance,
            interval.core_heat_capacity,
            interval.surface_resistance,
            interval.surface_heat_capacity,
            heats,
        )
    ]
    return np.min(surfaces, axis=0), np.max(surfaces, axis=0)


def _ends(values: Array, factors: tuple[float, float]) -> tuple[Array, Array]:
    low, high = factors[0] * values, factors[1] * values
    return np.minimum(low, high), np.maximum(low, high)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
