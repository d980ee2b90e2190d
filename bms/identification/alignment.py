"""State of charge of each row of several recordings, and the capacity that they agree on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.data.cycler import CyclerRecording
from bms.errors import InputError

_LONG_REST_S = 500.0
_REST_SHARE = 0.02
"""Of the current of 1C, below which a cell rests."""
_FULL_SHARE = 0.8
"""Of the widest recording's charge, above which a recording spans the cell."""
_SPECIMEN_SHARE = 0.012
"""By which capacities of one specimen differ at most."""
_LEAST_SWING_V = 0.1
"""From empty to full; the flattest cells, of iron phosphate or titanate, have 0.5 V and more."""
_LEAST_CHARGE_AH = 0.01


@dataclass(frozen=True)
class Alignment:
    """State of charge by recording, the capacity, and where it comes from.

    `slow` are the places of the recordings that the open-circuit voltage rests on.
    """

    capacity_Ah: float
    soc: tuple[Array, ...]
    specimens: tuple[int, ...]
    capacities_Ah: tuple[float, ...]
    slow: tuple[int, ...]
    reference: str
    reference_rate_C: float
    directions: tuple[str, ...]


@dataclass(frozen=True)
class Curve:
    """Voltage over state of charge, both rising."""

    soc: Array
    voltage_V: Array

    def soc_at(self, voltage_V: Array) -> Array:
        return np.interp(voltage_V, self.voltage_V, self.soc)


def align(recordings: Sequence[CyclerRecording], curve: Curve | None = None) -> Alignment:
    """States of charge by counting, tied to the slowest recording that spans the cell.

    Full (1) and empty (0) are its ends. Another recording is tied by its long rests where it has
    three, which also tell its own capacity, else by the voltage of its rest at the beginning, else
    by its voltages. InputError where no recording spans a cell.
    """
    spans_Ah = [float(np.ptp(recording.charge_out_As)) / 3600.0 for recording in recordings]
    widest_Ah = max(spans_Ah)
    if widest_Ah < _LEAST_CHARGE_AH:
        raise InputError(
            f"{recordings[0].path}: no recording moves more than {widest_Ah:.3g} Ah; "
            "give a charge or discharge of the whole cell, the slower the better"
        )
    for recording, span_Ah in zip(recordings, spans_Ah):
        moved_V = float(np.ptp(recording.voltage_V))
        if span_Ah > _FULL_SHARE * widest_Ah and moved_V < _LEAST_SWING_V:
            raise InputError(
                f"{recording.path}: voltage moves by {moved_V:.3g} V while {span_Ah:.3g} Ah flow, "
                f"which no whole cell's does by less than {_LEAST_SWING_V:g} V; another column is "
                "the voltage (--columns), or the recording is only a part of a cell's charge"
            )
    wide = [
        number
        for number, span_Ah in enumerate(spans_Ah)
        if span_Ah > _FULL_SHARE * widest_Ah and _is_one_way(recordings[number])
    ]
    if not wide:
        raise InputError(
            f"{recordings[0].path}: no recording charges or discharges the whole cell in one go; "
            "give one, the slower the better: without it nothing tells capacity and voltage"
        )
    slowest = min(wide, key=lambda number: _mean_A(recordings[number]))
    slow_A = _mean_A(recordings[slowest])
    slow = [number for number in wide if _mean_A(recordings[number]) < 1.5 * slow_A]
    capacity_Ah = float(np.mean([spans_Ah[number] for number in slow]))
    found = curve or _mean_curve([_curve(recordings[number]) for number in slow])
    tied = [
        tie(recording, capacity_Ah, found, is_slow=number in slow)
        for number, recording in enumerate(recordings)
    ]
    capacities = tuple(capacity for _, capacity in tied)
    return Alignment(
        capacity_Ah,
        tuple(soc for soc, _ in tied),
        _specimens(capacities, capacity_Ah),
        capacities,
        tuple(slow),
        ", ".join(recordings[number].name for number in slow),
        slow_A / capacity_Ah,
        tuple(sorted({"discharge" if _is_discharge(recordings[n]) else "charge" for n in slow})),
    )


def curve_of(soc: Sequence[float], voltage_V: Sequence[float]) -> Curve:
    """A curve that a second alignment is tied to, as of a fit."""
    return Curve(np.asarray(soc), np.asarray(voltage_V))


def rests(recording: CyclerRecording, capacity_Ah: float) -> list[tuple[int, int]]:
    """First and last row of each rest of more than 500 s."""
    resting = np.abs(recording.current_A) < _REST_SHARE * capacity_Ah
    edges = np.flatnonzero(np.diff(np.concatenate([[0], resting.astype(int), [0]])))
    return [
        (int(first), int(end) - 1)
        for first, end in zip(edges[::2], edges[1::2])
        if recording.time_s[end - 1] - recording.time_s[first] > _LONG_REST_S
    ]


def _mean_A(recording: CyclerRecording) -> float:
    flowing = np.abs(recording.current_A)
    return float(np.median(flowing[flowing > 0.02 * flowing.max()]))


def _is_one_way(recording: CyclerRecording) -> bool:
    moved_As = np.diff(recording.charge_out_As)
    there, back = float(np.sum(moved_As[moved_As > 0])), -float(np.sum(moved_As[moved_As < 0]))
    # Pulses and drive cycles stop or turn; a charge in one go does neither.
    flowing = np.abs(recording.current_A) > 0.02 * float(np.max(np.abs(recording.current_A)))
    span_s = np.diff(recording.time_s)
    moving_s = float(np.sum(span_s[flowing[1:]]))
    inside = np.flatnonzero(flowing)
    total_s = (
        float(recording.time_s[inside[-1]] - recording.time_s[inside[0]]) if len(inside) else 0
    )
    return min(there, back) < 0.02 * max(there, back) and moving_s > 0.9 * total_s


def _is_discharge(recording: CyclerRecording) -> bool:
    return bool(recording.charge_out_As[-1] > 0.0)


def _curve(recording: CyclerRecording) -> Curve:
    out_As = recording.charge_out_As
    soc = 1.0 - (out_As - out_As.min()) / float(np.ptp(out_As))
    order = np.argsort(soc, kind="stable")
    grid = np.linspace(0.0, 1.0, 401)
    voltage_V = np.maximum.accumulate(
        np.interp(grid, soc[order], recording.voltage_V[order]) + 1e-6 * grid
    )
    return Curve(grid, voltage_V + 1e-7 * np.arange(len(grid)))


def _mean_curve(curves: Sequence[Curve]) -> Curve:
    grid = curves[0].soc
    return Curve(grid, np.mean([np.interp(grid, c.soc, c.voltage_V) for c in curves], axis=0))


def tie(
    recording: CyclerRecording, capacity_Ah: float, curve: Curve, *, is_slow: bool
) -> tuple[Array, float]:
    """State of charge (N,) of one recording, and its specimen's capacity in Ah.

    A slow one spans 0 to 1.
    """
    out_Ah = recording.charge_out_As / 3600.0
    if is_slow:
        own_Ah = float(np.ptp(out_Ah))
        return 1.0 - (out_Ah - out_Ah.min()) / own_Ah, capacity_Ah
    last = [end for _, end in rests(recording, capacity_Ah)]
    inside = [end for end in last if curve.voltage_V[0] < recording.voltage_V[end]]
    if len(inside) >= 3 and np.ptp(out_Ah[inside]) > 0.3 * capacity_Ah:
        slope, first = np.polyfit(out_Ah[inside], curve.soc_at(recording.voltage_V[inside]), 1)
        own_Ah = -1.0 / float(slope)
        if abs(own_Ah / capacity_Ah - 1.0) < 0.3:
            return first - out_Ah / own_Ah, own_Ah
    if abs(recording.current_A[0]) < _REST_SHARE * capacity_Ah:
        first = float(curve.soc_at(recording.voltage_V[:1])[0])
        return first - out_Ah / capacity_Ah, capacity_Ah
    return _by_voltages(recording, capacity_Ah, curve, out_Ah), capacity_Ah


def _by_voltages(
    recording: CyclerRecording, capacity_Ah: float, curve: Curve, out_Ah: Array
) -> Array:
    """The beginning with which voltages follow the curve best, but for a resistance."""
    drive = np.column_stack([recording.current_A, np.ones_like(out_Ah)])

    def left(first: float) -> float:
        missing = recording.voltage_V - np.interp(
            first - out_Ah / capacity_Ah, curve.soc, curve.voltage_V
        )
        ohm = float(drive[:, 0] @ missing / max(float(drive[:, 0] @ drive[:, 0]), 1e-12))
        return float(np.sum((missing - min(ohm, 0.0) * drive[:, 0]) ** 2))

    low, high = float(out_Ah.max()) / capacity_Ah - 0.05, 1.0 + float(out_Ah.min()) / capacity_Ah
    grid = np.linspace(min(low, high), max(low, high) + 0.05, 141)
    return np.asarray(min(grid.tolist(), key=left) - out_Ah / capacity_Ah)


def _specimens(capacities_Ah: Sequence[float], reference_Ah: float) -> tuple[int, ...]:
    """0 for the cell of the slow recording, a number from 1 for each other capacity."""
    others: list[float] = []
    numbers = []
    for own_Ah in capacities_Ah:
        if abs(own_Ah / reference_Ah - 1.0) < _SPECIMEN_SHARE:
            numbers.append(0)
            continue
        near = [k for k, other in enumerate(others) if abs(own_Ah / other - 1.0) < _SPECIMEN_SHARE]
        if not near:
            others.append(own_Ah)
        numbers.append(near[0] + 1 if near else len(others))
    return tuple(numbers)
