"""What a log holds of one frame."""

from __future__ import annotations

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
