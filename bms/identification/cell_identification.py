"""A cell from surface-only recordings: alignment, electrical and thermal part in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bms.arrays import Array
from bms.data.cycler import CyclerRecording
from bms.identification.alignment import Alignment, align, curve_of
from bms.identification.electrical import (
    ACTIVATIONS_K,
    ElectricalFit,
    ElectricalRecord,
    fit_electrical,
    polarised_V,
)
from bms.identification.geometry import SURFACE_SHARE, Shape
from bms.identification.surface_thermal import (
    ENTROPY_SOC,
    ThermalFit,
    ThermalRecord,
    fit_thermal,
    heat_W,
    temperatures_K,
)

ASSUMED_K = 298.15
"""Of a recording without any temperature."""
LEAST_RISE_K = 2.0
"""Of a surface that tells heat capacity and cooling."""
VOLUMETRIC_J_PER_M3K = 2.2e6
"""Of lithium-ion cells, 1.6 to 2.8 in publications: for a cell whose warming was not recorded."""
AIR_W_PER_M2K = 15.0
"""From a surface to still or slow air, 5 to 40."""
_ROUNDS = 2
PARTS = 1 + 2 * _ROUNDS
"""That identify_cell notes."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class IdentifiedCell:
    """Everything that recordings told, and what of them it came from.

    `thermal` holds the fit for the middle, the least and the greatest core resistance;
    `is_thermal_fitted` is false where no surface warmed by 2 K with its ambient recorded.
    """

    recordings: tuple[CyclerRecording, ...]
    alignment: Alignment
    electrical: ElectricalFit
    shape: Shape
    thermal: tuple[ThermalFit, ThermalFit, ThermalFit]
    is_thermal_fitted: bool
    thermal_names: tuple[str, ...]
    core_K: tuple[Array, ...]


def identify_cell(
    recordings: Sequence[CyclerRecording],
    shape: Shape,
    entropic_V_per_K: Array | None = None,
    note: Progress = lambda part: None,
) -> IdentifiedCell:
    """Fit a cell to recordings without a measured core; InputError says what is missing."""
    note("aligning states of charge")
    alignment = align(recordings)
    core_K = tuple(_surface_K(recording) for recording in recordings)
    electrical = thermal = None
    for number in range(_ROUNDS):
        if electrical is not None:
            alignment = align(recordings, curve_of(electrical.ocv.soc, electrical.ocv.voltage_V))
        note(f"open-circuit voltage, resistance and branches, {number + 1} of {_ROUNDS}")
        records = electrical_records(recordings, alignment, core_K)
        coarse = ACTIVATIONS_K[1::4] if number == 0 else ACTIVATIONS_K
        electrical = fit_electrical(records, alignment.slow, alignment.capacity_Ah, coarse)
        note(f"heat capacity and cooling, {number + 1} of {_ROUNDS}")
        thermal, names = _thermal(recordings, alignment, electrical, shape, entropic_V_per_K)
        core_K = tuple(
            _core_K(recording, soc, electrical, thermal[0])
            for recording, soc in zip(recordings, alignment.soc)
        )
    assert electrical is not None and thermal is not None
    return IdentifiedCell(
        tuple(recordings), alignment, electrical, shape, thermal, bool(names), names, core_K
    )


def electrical_records(
    recordings: Sequence[CyclerRecording], alignment: Alignment, core_K: Sequence[Array]
) -> list[ElectricalRecord]:
    """What the electrical fit needs, in the recordings' order."""
    return [
        ElectricalRecord(one.name, one.time_s, one.current_A, one.voltage_V, soc, core, specimen)
        for one, soc, core, specimen in zip(recordings, alignment.soc, core_K, alignment.specimens)
    ]


def thermal_record(recording: CyclerRecording, soc: Array, irreversible_W: Array) -> ThermalRecord:
    """What the thermal fit needs; without an ambient it is the first surface temperature.

    Where the recording begins at rest, a difference of surface and ambient is one of the two
    sensors, and is taken out.
    """
    surface_K = _surface_K(recording)
    ambient_K = recording.ambient_K
    if ambient_K is None or recording.surface_K is None:
        ambient_K = np.full_like(surface_K, surface_K[0])
    else:
        ambient_K = ambient_K + sensor_offset_K(recording)
    return ThermalRecord(
        recording.name,
        recording.time_s,
        recording.current_A,
        soc,
        surface_K,
        ambient_K,
        irreversible_W,
    )


def sensor_offset_K(recording: CyclerRecording) -> float:
    """Surface above ambient in the first row, where both were recorded and the cell rests."""
    if recording.surface_K is None or recording.ambient_K is None:
        return 0.0
    strongest_A = float(np.max(np.abs(recording.current_A)))
    if abs(recording.current_A[0]) > 0.05 * strongest_A:
        return 0.0
    offset_K = float(recording.surface_K[0] - recording.ambient_K[0])
    return offset_K if abs(offset_K) < 1.0 else 0.0


def _surface_K(recording: CyclerRecording) -> Array:
    for temperature_K in (recording.surface_K, recording.ambient_K):
        if temperature_K is not None:
            return temperature_K
    return np.full_like(recording.time_s, ASSUMED_K)


def _thermal(
    recordings: Sequence[CyclerRecording],
    alignment: Alignment,
    electrical: ElectricalFit,
    shape: Shape,
    entropic_V_per_K: Array | None,
) -> tuple[tuple[ThermalFit, ThermalFit, ThermalFit], tuple[str, ...]]:
    records = [
        thermal_record(
            recording,
            soc,
            recording.current_A * (electrical.ocv(soc) - recording.voltage_V),
        )
        for recording, soc, specimen in zip(recordings, alignment.soc, alignment.specimens)
        if specimen == 0
        and recording.surface_K is not None
        and recording.ambient_K is not None
        and float(np.ptp(recording.surface_K)) > LEAST_RISE_K
    ]
    low, middle, high = shape.core_resistance_K_per_W
    _, share, _ = SURFACE_SHARE
    start_J_per_K = VOLUMETRIC_J_PER_M3K * shape.volume_m3
    if not records:
        nothing = _assumed(middle, share, start_J_per_K, shape, entropic_V_per_K)
        fits = tuple(
            replace(nothing, core_resistance_K_per_W=value) for value in (middle, low, high)
        )
        return (fits[0], fits[1], fits[2]), ()
    fits = tuple(
        fit_thermal(records, value, share, start_J_per_K, entropic_V_per_K)
        for value in (middle, low, high)
    )
    return (fits[0], fits[1], fits[2]), tuple(record.name for record in records)


def _assumed(
    core_resistance_K_per_W: float,
    share: float,
    total_J_per_K: float,
    shape: Shape,
    entropic_V_per_K: Array | None,
) -> ThermalFit:
    area_m2 = 5.0 * shape.volume_m3 ** (2.0 / 3.0)
    return ThermalFit(
        core_resistance_K_per_W,
        (1.0 - share) * total_J_per_K,
        1.0 / (AIR_W_PER_M2K * area_m2),
        share * total_J_per_K,
        np.zeros_like(ENTROPY_SOC) if entropic_V_per_K is None else entropic_V_per_K,
        0.15,
        0.4,
        3e-4,
        (),
    )


def _core_K(
    recording: CyclerRecording, soc: Array, electrical: ElectricalFit, thermal: ThermalFit
) -> Array:
    """Measured surface and what the model has the core above it."""
    irreversible_W = recording.current_A * (electrical.ocv(soc) - recording.voltage_V)
    record = thermal_record(recording, soc, irreversible_W)
    core_K, surface_K = temperatures_K(thermal, record, heat_W(record, thermal.entropic_V_per_K))
    return np.asarray(record.surface_K + core_K - surface_K)


def model_voltage_V(fit: ElectricalFit, record: ElectricalRecord) -> Array:
    """Terminal voltage of the described cell (specimen 0), whoever was measured."""
    ohmic = -record.current_A * fit.resistance_ohm(record.core_K, record.soc)
    polarised = polarised_V(fit, record.time_s, record.current_A)
    return np.asarray(fit.ocv(record.soc) + ohmic + polarised)
