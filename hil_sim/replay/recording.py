"""A log cut into control periods: what the ECU got before each step, and what it answered.

In lock step a SYNC frame is the step. In a log without SYNC, from real time, the step comes before
the first frame of an answer, which the ChargeCommand ends.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from bms.errors import InputError
from codegen import can_database
from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import FrameId, Message
from hil_sim.bus.database import MessageCodec
from hil_sim.logs import ALL, Log, LogFrame, Selection, Unread, head_command, log_format, read_log
from hil_sim.replay.beginning import middle_of_run, require_beginning
from hil_sim.replay.versions import require_version

LAST_MESSAGE = Message.CHARGE_COMMAND

Answer = tuple[Frame, ...]


@dataclass(frozen=True)
class Period:
    """What passed in one control period; `time_s` is that of the step."""

    time_s: float
    received: tuple[LogFrame, ...]
    answer_time_s: float
    answer: Answer


@dataclass(frozen=True)
class Recording:
    """A whole log, with the CAN database that explains it."""

    path: Path
    periods: tuple[Period, ...]
    lock_step: bool
    database: Mapping[str, MessageCodec]
    sent_by_ecu: frozenset[int]
    unread: Mapping[Unread, int]
    """How many of what is in the log besides."""

    @property
    def answers(self) -> list[Answer]:
        """What the ECU said, by period."""
        return [period.answer for period in self.periods]


def load_recording(path: Path, selection: Selection = ALL) -> Recording:
    """Read a log of any format.

    Raises InputError in one line when it cannot be read, is not of this project's bus or of another
    version of it, holds no answer, begins in the middle of a run or ends in the middle of a period.
    """
    messages = can_database.load_database().messages
    database = {message.name: MessageCodec(message) for message in messages}
    sent_by_ecu = frozenset(m.frame_id for m in messages if can_database.ECU in m.senders)
    log = read_log(path, selection)
    frames = [frame for frame in log.frames if not frame.is_extended]
    unread = Counter(log.unread)
    unread[Unread.EXTENDED_FRAMES] += len(log.frames) - len(frames)
    _require_ours(path, frames, database)
    require_version(path, frames, database)
    last_id = database[LAST_MESSAGE].frame_id
    lock_step = any(frame.frame_id == FrameId.SYNC for frame in frames)
    cut = _Cutter(path, sent_by_ecu, last_id)
    periods = tuple(cut.lock_step(frames) if lock_step else cut.real_time(frames))
    require_beginning(path, [period.answer for period in periods], database)
    if len(periods) > 1 and not _has(periods[-1], last_id) and _has(periods[-2], last_id):
        raise _cut_off(path, log, last_id)
    return Recording(path, periods, lock_step, database, sent_by_ecu, +unread)


class _Cutter:
    """Cuts frames into periods."""

    def __init__(self, path: Path, sent_by_ecu: frozenset[int], last_id: int) -> None:
        self._path = path
        self._sent_by_ecu = sent_by_ecu
        self._last_id = last_id

    def lock_step(self, frames: list[LogFrame]) -> Iterator[Period]:
        """One period for each SYNC, with all that the ECU says before the next one."""
        received: list[LogFrame] = []
        step: tuple[float, tuple[LogFrame, ...]] | None = None
        answer: list[LogFrame] = []
        for frame in frames:
            if frame.frame_id in self._sent_by_ecu:
                if step is None:
                    raise middle_of_run(self._path, "an answer comes before the first SYNC")
                answer.append(frame)
                continue
            received.append(frame)
            if frame.frame_id == FrameId.SYNC:
                if step is not None:
                    yield _period(*step, answer)
                step, answer, received = (frame.time_s, tuple(received)), [], []
        if step is not None:
            yield _period(*step, answer)

    def real_time(self, frames: list[LogFrame]) -> Iterator[Period]:
        """One period for each answer; what comes between its frames belongs to the next one."""
        received: list[LogFrame] = []
        step: tuple[float, tuple[LogFrame, ...]] | None = None
        answer: list[LogFrame] = []
        for frame in frames:
            if frame.frame_id not in self._sent_by_ecu:
                received.append(frame)
                continue
            if step is None:
                step, received = (frame.time_s, tuple(received)), []
            answer.append(frame)
            if frame.frame_id == self._last_id:
                yield _period(*step, answer)
                step, answer = None, []
        if step is not None:
            yield _period(*step, answer)


def _period(time_s: float, received: tuple[LogFrame, ...], answer: list[LogFrame]) -> Period:
    frames = tuple(Frame(frame.frame_id, frame.data) for frame in answer)
    return Period(time_s, received, answer[0].time_s if answer else time_s, frames)


def _has(period: Period, frame_id: int) -> bool:
    return any(frame.frame_id == frame_id for frame in period.answer)


def _require_ours(path: Path, frames: list[LogFrame], database: Mapping[str, MessageCodec]) -> None:
    protected = {codec.frame_id: codec for codec in database.values() if codec.data_ids}
    if not any(
        frame.frame_id in protected and protected[frame.frame_id].decode(frame.data) is not None
        for frame in frames
    ):
        raise InputError(
            f"{path}: foreign, no intact frame of codegen/can/bms.dbc is in it; "
            "give a log of 'bms sil --log FILE'"
        )
    last_id = database[LAST_MESSAGE].frame_id
    if not any(frame.frame_id == last_id for frame in frames):
        raise InputError(
            f"{path}: no {LAST_MESSAGE} is in it, so there is nothing to compare; "
            "record while an ECU answers"
        )


def _cut_off(path: Path, log: Log, last_id: int) -> InputError:
    *_, last = (
        n
        for n, frame in enumerate(log.frames)
        if frame.frame_id == last_id and not frame.is_extended
    )
    if log_format(path).is_text:
        line = log.places[last]
        place = f" (after the {LAST_MESSAGE} in line {line})"
        remedy = f", or keep what is whole: {head_command(path, line)}"
    else:
        place, remedy = "", ""
    return InputError(
        f"{path}: cut off in the middle of a control period{place}; record it again{remedy}"
    )
