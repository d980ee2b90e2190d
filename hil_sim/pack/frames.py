"""Frames between Python and C."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

from hil_sim.bus.frame import Frame
from hil_sim.studies.pack._pack import ffi

FRAME = struct.Struct("=IB8s3x")
assert FRAME.size == ffi.sizeof("can_frame_t")
_MOST_DATA = 8


def packed(frames: Sequence[tuple[int, bytes]]) -> bytes:
    """An array of can_frame_t; a length beyond 8 stays visible as 9."""
    pack = FRAME.pack
    return b"".join([pack(i, min(len(data), _MOST_DATA + 1), data) for i, data in frames])


def unpacked(frames: Any, count: int) -> list[Frame]:
    """The first frames of an array of can_frame_t."""
    content = bytes(ffi.buffer(frames, count * FRAME.size))
    return [Frame(i, data[:length]) for i, length, data in FRAME.iter_unpack(content)]
