"""A pack's log fed to a freshly started ECU, and its answers beside the recorded ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bms.errors import InputError
from codegen import can_database
from hil_sim.bus.catalog import CommandState
from hil_sim.bus.frame import Frame
from hil_sim.logs import LogFrame, Selection, read_log
from hil_sim.monitor.pack_model import pack_codecs, pack_database
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.settings import PackChargeSettings

_IDENTITY, _COMMAND, _SYNC = "PackIdentity", "PackCommand", "SYNC"


@dataclass(frozen=True)
class Period:
    """Frames that an ECU got up to a SYNC, and those that it answered."""

    time_s: float
    received: tuple[Frame, ...]
    answer: tuple[Frame, ...]


@dataclass(frozen=True)
class Difference:
    """A period in which the answers are not the same; signals as (recorded, now), by name."""

    period: int
    time_s: float
    signals: dict[str, tuple[float | None, float | None]]


@dataclass(frozen=True)
class Comparison:
    """What a replay found; `first` is None where every frame is the same."""

    periods: int
    frames: int
    differing_periods: int
    first: Difference | None

    @property
    def is_equal(self) -> bool:
        """Whether the ECU answers as it did, byte by byte."""
        return self.differing_periods == 0


def replay_pack(log: Path, settings: PackChargeSettings, selection: Selection) -> Comparison:
    """Replay a log from its beginning.

    Raises InputError in one line for what read_log refuses, a log without a pack in lock step, and
    one whose ECU has other cells, another preset or another model.
    """
    periods = tuple(_periods(log, [f for f in read_log(log, selection) if not f.is_extended]))
    _require_same_ecu(log, periods, settings)
    _require_whole(log, periods)
    ecu = PackEcu(settings)
    differing, first, frames = 0, None, 0
    for number, period in enumerate(periods):
        answer = tuple(ecu.exchange(period.received))
        frames += len(answer)
        if answer != period.answer:
            differing += 1
            if first is None:
                signals = _differing_signals(period.answer, answer)
                first = Difference(number, period.time_s, signals)
    return Comparison(len(periods), frames, differing, first)


def _periods(log: Path, frames: Sequence[LogFrame]) -> Iterator[Period]:
    messages = pack_database().messages
    said = frozenset(m.frame_id for m in messages if can_database.ECU in m.senders)
    sync_id = next(m.frame_id for m in messages if m.name == _SYNC)
    if not any(f.frame_id == sync_id for f in frames) or not any(
        f.frame_id in said for f in frames
    ):
        raise InputError(
            f"{log}: holds no pack in lock step, with SYNC and answers of its ECU; leave out "
            "--cells for the log of one cell, or record one with 'bms sil --cells 16 --out DIR'"
        )
    waiting: list[Frame] = []
    answer: list[Frame] = []
    step: tuple[float, tuple[Frame, ...]] | None = None
    for one in frames:
        frame = Frame(one.frame_id, one.data)
        if one.frame_id in said:
            answer.append(frame)
            continue
        if step is not None and (answer or one.frame_id == sync_id):
            yield Period(*step, tuple(answer))
            step, answer = None, []
        waiting.append(frame)
        if one.frame_id == sync_id:
            step, waiting = (one.time_s, tuple(waiting)), []
    if step is not None:
        yield Period(*step, tuple(answer))


def _require_same_ecu(log: Path, periods: Sequence[Period], settings: PackChargeSettings) -> None:
    codec = pack_codecs()[_IDENTITY]
    told = [
        values
        for period in periods
        for frame in period.answer
        if frame.frame_id == codec.frame_id and (values := codec.decode(frame.data)) is not None
    ]
    if not told:
        raise InputError(
            f"{log}: its ECU never says what it has (PackIdentity); record a whole run"
        )
    has = tuple(int(told[0][name] or 0) for name in ("Cells", "PresetHash", "ModelHash"))
    wanted = (settings.cells, int(settings.preset.hash[:4], 16), int(settings.model.hash[:8], 16))
    if has != wanted:
        raise InputError(
            f"{log}: its ECU has {has[0]} cells, preset {has[1]:04x} and model {has[2]:08x}, not "
            f"{wanted[0]} cells of '{settings.preset.name}' ({wanted[1]:04x}, {wanted[2]:08x}); "
            "give its --cells, --preset and --model"
        )


def _require_whole(log: Path, periods: Sequence[Period]) -> None:
    """An ECU that is in the middle of a charge has a past that the log does not hold."""
    codec = pack_codecs()[_COMMAND]
    commands = [[f for f in one.answer if f.frame_id == codec.frame_id] for one in periods]
    begins = next((codec.decode(answer[0].data) for answer in commands if answer), None) or {}
    if begins.get("CommandState") not in (CommandState.INIT, CommandState.STANDBY):
        raise InputError(f"{log}: begins in the middle of a run; give the log from its beginning")
    if len(commands) > 1 and commands[-2] and not commands[-1]:
        raise InputError(
            f"{log}: ends in the middle of a period, at {periods[-1].time_s:g} s; cut it off before"
        )


def _differing_signals(
    recorded: Sequence[Frame], now: Sequence[Frame]
) -> dict[str, tuple[float | None, float | None]]:
    before, after = _decoded(recorded), _decoded(now)
    names = [*before, *(name for name in after if name not in before)]
    return {
        name: (before.get(name), after.get(name))
        for name in names
        if before.get(name) != after.get(name)
    }


def _decoded(frames: Sequence[Frame]) -> dict[str, float | None]:
    codecs = {codec.frame_id: codec for codec in pack_codecs().values()}
    found: dict[str, float | None] = {}
    for frame in frames:
        codec = codecs.get(frame.frame_id)
        found.update((codec.decode(frame.data) if codec else None) or {})
    return found


def as_dict(log: Path, settings: PackChargeSettings, comparison: Comparison) -> dict[str, Any]:
    """Content for JSON."""
    first = comparison.first
    return {
        "log": str(log),
        "preset": settings.preset.name,
        "cells": settings.cells,
        "periods": comparison.periods,
        "frames": comparison.frames,
        "equal": comparison.is_equal,
        "differing_periods": comparison.differing_periods,
        "first_difference": None
        if first is None
        else {
            "period": first.period,
            "time_s": first.time_s,
            "signals": {name: list(values) for name, values in first.signals.items()},
        },
    }
