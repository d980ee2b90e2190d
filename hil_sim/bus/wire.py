"""The plant's side of a control period in C: values to protected frames and back, all at once.

Layout, ranges and data ids are those of the CAN database, CRC and counters the firmware's own code.
MessageCodec does the same for one message in Python, and the tests hold one to the other.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence
from typing import Any

from hil_sim.bus.database import MessageCodec
from hil_sim.bus.frame import Frame, frames_of
from hil_sim.native._native import ffi, lib

_FRAME = struct.Struct("=IB8s3x")
assert _FRAME.size == ffi.sizeof("can_frame_t")
_MOST_DATA = 8
_NAN = math.nan


class Publisher:
    """Frames of several messages, each with the next counter of its own."""

    def __init__(self, codecs: Sequence[MessageCodec]) -> None:
        self._wire = ffi.new("wire_t *", wire_fields(codecs))
        self._values = ffi.new("double[]", sum(len(codec.signals) for codec in codecs))
        self._frames = ffi.new("can_frame_t[]", len(codecs))
        self._bytes = ffi.buffer(self._frames)
        self._ends = [0]
        for codec in codecs:
            self._ends.append(self._ends[-1] + len(codec.signals))

    def frames(self, values: Sequence[float | None], messages: int) -> list[Frame]:
        """Frames of the first messages, with a value for each of their signals in order.

        The units are the database's; None and NaN stand for what is not available.
        """
        self._values[0 : self._ends[messages]] = [_NAN if v is None else v for v in values]
        lib.wire_send(self._wire, messages, self._values, self._frames)
        content = bytes(self._bytes[: messages * _FRAME.size])
        return frames_of([(i, data[:length]) for i, length, data in _FRAME.iter_unpack(content)])


class Listener:
    """Latest values of several messages, as they came in one control period."""

    def __init__(self, codecs: Sequence[MessageCodec]) -> None:
        names = [signal.name for codec in codecs for signal in codec.signals]
        self.places = {name: place for place, name in enumerate(names)}
        """Where the value of each signal stands."""
        self._count = len(names)
        self._wire = ffi.new("wire_t *", wire_fields(codecs))
        self._values = ffi.new("double[]", self._count)
        self._unknown = [_NAN] * self._count

    def hear(self, frames: Iterable[Frame]) -> list[float]:
        """Values after the frames of a period, NaN for what was not said or is not available.

        A frame counts when it is intact and, where it has a counter, does not repeat the last one.
        """
        content = b"".join(
            [_FRAME.pack(i, len(data), data) for i, data in frames if len(data) <= _MOST_DATA]
        )
        values = self._values
        values[0 : self._count] = self._unknown
        count = len(content) // _FRAME.size
        lib.wire_receive(self._wire, ffi.from_buffer("can_frame_t[]", content), count, values)
        heard: list[float] = ffi.unpack(values, self._count)
        return heard


class Decoder:
    """One message, judged by somebody else: whether a payload is intact, and its values."""

    def __init__(self, codec: MessageCodec) -> None:
        self._message = ffi.new("wire_message_t *", message_fields(codec))
        self._values = ffi.new("double[]", len(codec.signals))
        self._count = len(codec.signals)

    def is_intact(self, data: bytes) -> bool:
        """Whether length and CRC are right."""
        return bool(lib.wire_is_intact(self._message, data, len(data)))

    def values(self, data: bytes) -> list[float]:
        """Value of each signal of an intact payload, NaN for what is not available."""
        lib.wire_decode(self._message, data, self._values)
        values: list[float] = ffi.unpack(self._values, self._count)
        return values


def wire_fields(codecs: Sequence[MessageCodec]) -> dict[str, Any]:
    """Content of the C structure of messages that are sent together."""
    return {"messages": len(codecs), "message": [message_fields(codec) for codec in codecs]}


def message_fields(codec: MessageCodec) -> dict[str, Any]:
    """Content of the C structure of a message."""
    return {
        "id": codec.frame_id,
        "length": codec.length,
        "is_protected": bool(codec.data_ids),
        "data_ids": list(codec.data_ids),
        "signals": len(codec.signals),
        "signal": [
            {
                "start": signal.start,
                "length": signal.length,
                "scale": signal.scale,
                "offset_steps": signal.offset_steps,
                "lowest": signal.lowest,
                "highest": signal.highest,
            }
            for signal in codec.signals
        ],
    }
