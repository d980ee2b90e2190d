"""What comes from a bus and is no frame of this project's kind: how to tell, and how to count."""

from __future__ import annotations

from collections import Counter
from enum import Enum

import can


class ForeignFrame(Enum):
    """Kinds of frames that no node of this project sends or takes."""

    EXTENDED = "extended"
    REMOTE = "remote"
    ERROR = "error"
    FD = "FD"
    UNREADABLE = "unreadable"
    """No frame at all, such as a datagram of somebody else or a damaged line."""


def foreign_kind(message: can.Message) -> ForeignFrame | None:
    """The kind of a message; None for a classical data frame with an 11-bit identifier."""
    if message.is_error_frame:
        return ForeignFrame.ERROR
    if message.is_fd:
        return ForeignFrame.FD
    if message.is_remote_frame:
        return ForeignFrame.REMOTE
    return ForeignFrame.EXTENDED if message.is_extended_id else None


def is_unreadable(error: Exception) -> bool:
    """Whether an adapter could not read what came; False where the bus itself has failed.

    The adapters of python-can let what their parser raises pass, or name it as the cause.
    """
    if isinstance(error, can.CanError):
        cause = error.__cause__
        return cause is not None and not isinstance(cause, (OSError, can.CanError))
    return isinstance(error, (ValueError, LookupError))


def counts_text(counts: Counter[ForeignFrame]) -> str:
    """Counts by kind, such as `3 remote, 1 unreadable`."""
    return ", ".join(f"{counts[kind]} {kind.value}" for kind in ForeignFrame if counts[kind])
