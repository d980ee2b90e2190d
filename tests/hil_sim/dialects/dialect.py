"""What a dialect is, and what the texts of several have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from hil_sim.logs import LogFrame, Unread


@dataclass(frozen=True)
class Dialect:
    """How one tool writes a format; `foreign` are lines of it that are no classical data frames.

    A foreign line has the time as `{time}` in s, `{time_ms}` or `{time_us}`.
    """

    suffix: str
    write: Callable[[Sequence[LogFrame]], bytes]
    foreign: dict[str, tuple[Unread, int]] = field(default_factory=dict)
    keeps_direction: bool = True


def text(lines: Sequence[str], end: str = "\n") -> bytes:
    return "".join(f"{line}{end}" for line in lines).encode()


def hexed(data: bytes, separator: str = " ") -> str:
    return data.hex(separator).upper() if separator else data.hex().upper()


def direction(frame: LogFrame) -> str:
    return "Rx" if frame.received else "Tx"
