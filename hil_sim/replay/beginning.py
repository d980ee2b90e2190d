"""Whether a recording begins with the start of its ECU, whose state is known only then.

The counter of a message returns to 0 after 16 of them, so it alone tells nothing about a log that
lacks 16 periods. Hence four signs are looked for in the first answer, of which a fresh ECU shows
none: a counter other than 0; no Identity though later answers have one; a state other than Init;
a message from the plant whose supervision is over its start, which takes several good frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from bms.errors import InputError
from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import (
    CommandState,
    FirstFault,
    FrameId,
    Message,
    ReportedState,
)
from hil_sim.bus.database import MessageCodec

_FRESH_SUPERVISION = (ReportedState.NO_DATA, ReportedState.INIT)


def require_beginning(
    path: Path, answers: Sequence[Sequence[Frame]], database: Mapping[str, MessageCodec]
) -> None:
    """Raise InputError for answers, by period, that begin in the middle of a run."""
    for sign in _signs(answers, database):
        raise middle_of_run(path, sign)


def middle_of_run(path: Path, sign: str) -> InputError:
    """The refusal of a log that shows a sign of a run before it."""
    return InputError(
        f"{path}: begins in the middle of a run ({sign}), so the state of the ECU is not known; "
        "start the recording before the ECU"
    )


def _signs(
    answers: Sequence[Sequence[Frame]], database: Mapping[str, MessageCodec]
) -> Iterator[str]:
    first: Sequence[Frame] = next((answer for answer in answers if answer), ())
    command = database[Message.CHARGE_COMMAND]
    counters = (
        command.counter(frame.data)
        for answer in answers
        for frame in answer
        if frame.frame_id == command.frame_id and command.is_intact(frame.data)
    )
    if counter := next(counters, 0):
        yield f"the first {command.name} has counter {counter}"
    if not _has_identity(first) and any(map(_has_identity, answers)):
        yield f"the first {Message.IDENTITY} is not in the first answer"
    state = _value(first, command, "CommandState")
    fault = _value(first, database[Message.DIAGNOSTICS], "FirstFault")
    # Without a calibration a fresh ECU is in Fault.
    if state not in (None, CommandState.INIT) and fault != FirstFault.CALIBRATION:
        yield f"the first {command.name} says {command.choices['CommandState'].get(state, state)}"
    network = database[Message.NETWORK_DIAGNOSTICS]
    supervision = _value(first, network, "ReportedState")
    if supervision is not None and supervision not in _FRESH_SUPERVISION:
        number = _value(first, network, "ReportedMessage")
        reported = network.choices["ReportedMessage"].get(-1 if number is None else number)
        state_name = network.choices["ReportedState"].get(supervision, supervision)
        yield f"{reported or network.name} is {state_name} in the first answer"


def _has_identity(answer: Sequence[Frame]) -> bool:
    return any(frame.frame_id == FrameId.IDENTITY for frame in answer)


def _value(answer: Sequence[Frame], codec: MessageCodec, signal: str) -> int | None:
    """Of a signal in the first intact frame of its message; None without one."""
    for frame in answer:
        if frame.frame_id == codec.frame_id and (values := codec.decode(frame.data)):
            value = values.get(signal)
            return None if value is None else int(value)
    return None
