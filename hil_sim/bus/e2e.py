"""Sender and receiver of one message under AUTOSAR E2E profile 2: a counter on top of the CRC."""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.bus.buses import Frame
from hil_sim.bus.database import COUNTER_MODULUS, MessageCodec, Values


class Sender:
    """Numbers the frames of one message."""

    def __init__(self, codec: MessageCodec) -> None:
        self._codec = codec
        self._counter = 0

    def frame(self, values: Mapping[str, float | None]) -> Frame:
        """Frame with these values and the next counter."""
        data = self._codec.encode(values, self._counter)
        self._counter = (self._counter + 1) % COUNTER_MODULUS
        return Frame(self._codec.frame_id, data)


class Receiver:
    """Takes new, intact frames of one message; the counter must move, by however much.

    For reports and for controllers that are compared with. What acts on the cell goes through
    bms.firmware.Reception, which also judges a message over several periods.
    """

    def __init__(self, codec: MessageCodec) -> None:
        self._codec = codec
        self._last_counter: int | None = None

    def accept(self, data: bytes) -> Values | None:
        """Decoded values, or None when the frame is corrupt or repeats the last one."""
        values = self._codec.decode(data)
        if values is None or not self._codec.data_ids:
            return values
        counter = self._codec.counter(data)
        if counter == self._last_counter:
            return None
        self._last_counter = counter
        return values
