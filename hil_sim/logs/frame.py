"""What a log holds: frames that are read, and what else is counted."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class LogFrame(NamedTuple):
    """A classical data frame with 0 to 8 bytes; time in s, in whole microseconds.

    `received` is False for what the recording party sent itself, here the plant.
    """

    time_s: float
    frame_id: int
    data: bytes
    is_extended: bool = False
    received: bool = True


class Unread(Enum):
    """What a log may hold beside the frames that are read: name of one, name of several."""

    REMOTE_FRAMES = "remote frame", "remote frames"
    ERROR_FRAMES = "error frame", "error frames"
    CAN_FD_FRAMES = "CAN FD frame", "CAN FD frames"
    CAN_XL_FRAMES = "CAN XL frame", "CAN XL frames"
    LONG_DLC_FRAMES = "frame with a DLC of 9 to 15", "frames with a DLC of 9 to 15"
    EXTENDED_FRAMES = "frame with a 29-bit identifier", "frames with 29-bit identifiers"
    OTHER_CHANNEL_FRAMES = "frame of another channel", "frames of other channels"
    LOST_FRAMES = "frame that the recorder lost", "frames that the recorder lost"
    TRANSMIT_REQUESTS = "transmit request", "transmit requests"
    OTHER_ENTRIES = "entry that is no frame", "entries that are no frames"

    def text(self, count: int) -> str:
        """Count and name for a reader."""
        one, several = self.value
        return f"{count} {one if count == 1 else several}"


class Entry(NamedTuple):
    """One entry of a log: a data frame, or what is not read and why.

    `time_s` is None for an entry without a time, `channel` empty for a format without channels,
    and `number` more than 1 where one entry stands for several frames.
    """

    time_s: float | None
    channel: str = ""
    frame_id: int = 0
    data: bytes = b""
    is_extended: bool = False
    received: bool = True
    unread: Unread | None = None
    number: int = 1


class UnreadableError(Exception):
    """A place of a log that cannot be read: why, what can be done if that is known, and where.

    read_log makes an InputError of it.
    """

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__(reason)
        self.remedy = remedy
        self.where = ""


class CutOffError(UnreadableError):
    """A log that ends before its end."""
