"""Frames of a period as values of signals, with names, units and text for readers."""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterable, Mapping
from functools import cached_property

from codegen import can_database
from hil_sim.bus.buses import Frame
from hil_sim.bus.database import MessageCodec, Values
from hil_sim.bus.fault_bits import FIRST_FAULTS

_FAULT_BITS = {"ActiveFaults": 0, "LatchedFaults": 0, "MoreFaults": FIRST_FAULTS}
"""Signals with a bit for each fault, and the fault of the first bit."""
_UNIT_NAMES = {"": "", "1": "", "1/s": "per_s", "K/s": "K_per_s", "K/s^2": "K_per_s2"}


class Signals:
    """The CAN database from a reader's point of view."""

    def __init__(self, database: Mapping[str, MessageCodec]) -> None:
        self._codecs = {codec.frame_id: codec for codec in database.values()}
        self._choices = {
            name: choices for codec in database.values() for name, choices in codec.choices.items()
        }

    @cached_property
    def _units(self) -> dict[str, str]:
        messages = can_database.load_database().messages
        return {signal.name: signal.unit or "" for m in messages for signal in m.signals}

    def message(self, frame_id: int) -> str:
        """Name of a message, or its identifier when the database has none."""
        codec = self._codecs.get(frame_id)
        return codec.name if codec else f"{frame_id:03X}"

    def unit(self, signal: str) -> str:
        """Unit as text; empty for a number without one."""
        unit = self._units.get(signal, "")
        return "" if unit == "1" else unit

    def is_quantity(self, signal: str) -> bool:
        """Whether the difference of two values means something, as it does not for names."""
        return signal not in self._choices and signal not in _FAULT_BITS

    def key(self, signal: str) -> str:
        """Name with the unit, for JSON."""
        unit = self._units.get(signal, "")
        return f"{signal}_{_UNIT_NAMES.get(unit, unit)}".rstrip("_")

    def decode(self, frames: Iterable[Frame]) -> Values:
        """Values of all intact frames; a signal that did not come is left out."""
        values: Values = {}
        for frame in frames:
            codec = self._codecs.get(frame.frame_id)
            values.update((codec.decode(frame.data) if codec else None) or {})
        return values

    def text(self, signal: str, values: Values) -> str:
        """A value for a reader."""
        if signal not in values:
            return "-"
        value = values[signal]
        if value is None:
            return "not available"
        if signal in _FAULT_BITS:
            return ", ".join(self.faults(int(value) << _FAULT_BITS[signal])) or "none"
        choices = self._choices.get(signal)
        return choices.get(int(value), f"{value:g}") if choices else f"{value:.10g}"

    @staticmethod
    def fault_bits(values: Values) -> int:
        """Bits of all faults that are active or latched, as far as these values tell."""
        told = ((values.get(signal), first) for signal, first in _FAULT_BITS.items())
        return functools.reduce(operator.or_, (int(bits or 0) << first for bits, first in told))

    def faults(self, bits: int) -> list[str]:
        """Names of the faults whose bits are set."""
        names = self._choices["FirstFault"]
        return [names.get(n, str(n)) for n in range(bits.bit_length()) if bits >> n & 1]
