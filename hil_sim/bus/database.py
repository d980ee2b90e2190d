"""The CAN database codegen/can/bms.dbc, read by cantools, with saturation and 'not available'.

A value beyond a signal's range is sent as the end of the range. None is sent as the pattern of
all ones, which lies outside the range of every signal that can be unavailable.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from codegen import can_database

COUNTER_MODULUS = 16
_POLYNOMIAL = 0x2F

Values = dict[str, "float | None"]


@dataclass(frozen=True)
class Signal:
    """Place and scaling of a signal, the offset and range in steps; so what is read is exact.

    An unsigned little-endian field of `length` bits from bit `start` on.
    """

    name: str
    start: int
    length: int
    scale: float
    offset_steps: int
    lowest: int
    highest: int

    @property
    def all_ones(self) -> int:
        """What is sent for a value that is not available."""
        return (1 << self.length) - 1

    def raw(self, value: float | None) -> int:
        """Raw value of a physical one, within the range."""
        if value is None or math.isnan(value):
            return self.all_ones
        steps = value / self.scale - self.offset_steps
        return round(min(max(steps, self.lowest), self.highest))

    def physical(self, raw: int) -> float | None:
        """Physical value of a raw one; None outside of the range."""
        if not self.lowest <= raw <= self.highest:
            return None
        return (raw + self.offset_steps) * self.scale


class MessageCodec:
    """One message of the database: payload to values and back, with its E2E profile 2 header."""

    def __init__(self, message: Any) -> None:
        self.name: str = message.name
        self.frame_id: int = message.frame_id
        self.length: int = message.length
        self._message = message
        self._counter = f"{message.name}Counter"
        self._crc = f"{message.name}Crc"
        self.data_ids = can_database.data_ids(message)
        self.signals = [
            _signal(s) for s in message.signals if s.name not in (self._counter, self._crc)
        ]
        """All signals apart from CRC and counter."""

    @property
    def signal_names(self) -> list[str]:
        """Names of the signals apart from CRC and counter."""
        return [signal.name for signal in self.signals]

    def encode(self, values: Mapping[str, float | None], counter: int = 0) -> bytes:
        """Payload with these values in the database's units; a signal left out is not available."""
        raw = {signal.name: signal.raw(values.get(signal.name)) for signal in self.signals}
        if not self.data_ids:
            return bytes(self._message.encode(raw, scaling=False, strict=False))
        raw[self._counter], raw[self._crc] = counter, 0
        payload = bytearray(self._message.encode(raw, scaling=False, strict=False))
        payload[0] = profile2_crc(payload, self.data_ids[counter])
        return bytes(payload)

    def is_intact(self, data: bytes) -> bool:
        """Whether length and CRC are right."""
        if len(data) != self.length:
            return False
        return not self.data_ids or data[0] == profile2_crc(data, self.data_ids[self.counter(data)])

    def decode(self, data: bytes) -> Values | None:
        """Values in the database's units, None for each that is not available.

        None as a whole when length or CRC is wrong.
        """
        if not self.is_intact(data):
            return None
        raw = self._message.decode(data, decode_choices=False, scaling=False)
        return {signal.name: signal.physical(raw[signal.name]) for signal in self.signals}

    @staticmethod
    def counter(data: bytes) -> int:
        """The E2E counter of a payload of at least two bytes."""
        return data[1] % COUNTER_MODULUS

    @cached_property
    def choices(self) -> dict[str, dict[int, str]]:
        """Names of the values of each signal that has such."""
        return {
            signal.name: {int(value): str(name) for value, name in signal.choices.items()}
            for signal in self._message.signals
            if signal.choices
        }


def profile2_crc(payload: bytes | bytearray, data_id: int) -> int:
    """CRC-8H2F over all of a payload but its first byte, then the data id.

    Source: AUTOSAR E2E protocol specification, profile 2. cantools has it too, six times slower.
    """
    crc = 0xFF
    for byte in payload[1:]:
        crc = _CRC_TABLE[crc ^ byte]
    return _CRC_TABLE[crc ^ data_id] ^ 0xFF


def load_codecs() -> dict[str, MessageCodec]:
    """Every message of the project's CAN database by name."""
    return {m.name: MessageCodec(m) for m in can_database.load_database().messages}


def _crc_of_byte(byte: int) -> int:
    for _ in range(8):
        byte = (byte << 1) ^ (_POLYNOMIAL if byte & 0x80 else 0)
    return byte & 0xFF


_CRC_TABLE = bytes(map(_crc_of_byte, range(256)))


def _signal(signal: Any) -> Signal:
    assert signal.byte_order == "little_endian" and not signal.is_signed, signal.name
    return Signal(
        name=signal.name,
        start=signal.start,
        length=signal.length,
        scale=signal.scale,
        offset_steps=round(signal.offset / signal.scale),
        lowest=round((signal.minimum - signal.offset) / signal.scale),
        highest=round((signal.maximum - signal.offset) / signal.scale),
    )
