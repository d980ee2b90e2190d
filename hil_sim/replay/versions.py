"""Which version of the CAN database the frames of a log, or of a build, are laid out by."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from bms.errors import InputError
from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import NETWORK_VERSION, Message
from hil_sim.bus.database import MessageCodec, Values
from hil_sim.bus.identity import Identity
from hil_sim.logs import LogFrame

_REMEDY = "replay it with the bms that it was recorded with, or record it again"


def first_identity(
    frames: Iterable[Frame | LogFrame], database: Mapping[str, MessageCodec]
) -> Identity | None:
    """What the first Identity among frames with 11-bit identifiers says; None without any."""
    values = _first(Message.IDENTITY, frames, database)
    return None if values is None else Identity.of(values.get)


def first_content(
    frames: Iterable[Frame | LogFrame], database: Mapping[str, MessageCodec]
) -> int | None:
    """CalibrationContent of the first Start among frames with 11-bit identifiers, if any."""
    values = _first(Message.START, frames, database)
    content = None if values is None else values.get("CalibrationContent")
    return None if content is None else int(content)


def _first(
    message: str, frames: Iterable[Frame | LogFrame], database: Mapping[str, MessageCodec]
) -> Values | None:
    codec = database[message]
    for frame in frames:
        if frame.frame_id == codec.frame_id and (values := codec.decode(frame.data)):
            return values
    return None


def require_version(
    path: Path, frames: Iterable[LogFrame], database: Mapping[str, MessageCodec]
) -> None:
    """Raise InputError for the frames of a log of another version of the database.

    Without an Identity to name it, that is one of which no ChargeCommand is intact.
    """
    frames = list(frames)
    identity = first_identity(frames, database)
    if identity is not None and identity.other_version is not None:
        raise InputError(f"{path}: recorded with {identity.other_version}; {_REMEDY}")
    command = database[Message.CHARGE_COMMAND]
    commands = [frame.data for frame in frames if frame.frame_id == command.frame_id]
    if commands and not any(map(command.is_intact, commands)):
        raise InputError(
            f"{path}: no {command.name} is intact by version {NETWORK_VERSION} of the CAN "
            f"database, so the log is of another version or damaged; {_REMEDY}"
        )


def require_answers_of_version(
    build: Path, answers: Iterable[Frame], database: Mapping[str, MessageCodec]
) -> None:
    """Raise InputError for a build that speaks another version than the logs that it is fed."""
    identity = first_identity(answers, database)
    if identity is not None and identity.other_version is not None:
        raise InputError(
            f"build {build}: answers with {identity.other_version}, so the two cannot be "
            "compared; compare builds that have the version of the logs"
        )
