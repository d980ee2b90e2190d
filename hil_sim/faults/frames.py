"""Faults of the network: of one message in either direction, of the bus as a whole.

SYNC is left alone: in lock step it stands for the clock of the ECU, which no network fault stops.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le

from bms.errors import InputError
from bms.validation import strict
from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import Message, RequiredName, SentName
from hil_sim.bus.database import COUNTER_MODULUS, MessageCodec, profile2_crc
from hil_sim.bus.limits import HIGHEST_STANDARD_ID, MAX_DATA_LENGTH
from hil_sim.faults.base import Fault

MessageName = Literal[RequiredName, SentName]
"""What passes in a run: the plant sends no optional message, and a boot stage none that starts."""


@dataclass
class FrameMemory:
    """What a frame fault keeps from one period to the next."""

    database: Mapping[str, MessageCodec]
    rng: np.random.Generator
    kept: list[Frame] = field(default_factory=list)


class FrameFault(Fault):
    """Changes the frames that pass in a period."""

    hits_what_ecu_sends = True

    @property
    def where(self) -> str:
        """The bus as a whole, unless a kind of fault names something narrower."""
        return "bus"

    def check(self, database: Mapping[str, MessageCodec]) -> None:
        """Raise InputError when it does not fit the CAN database."""

    @abstractmethod
    def apply(self, frames: list[Frame], active: bool, memory: FrameMemory) -> list[Frame]:
        """Frames that arrive in place of those sent in one direction; called in every period."""


@strict
@dataclass(frozen=True, kw_only=True)
class MessageFault(FrameFault):
    """A fault of the frames of one message."""

    message: MessageName

    @property
    def where(self) -> str:
        """Name of the message whose frames are hit."""
        return self.message

    def apply(self, frames: list[Frame], active: bool, memory: FrameMemory) -> list[Frame]:
        """All frames, with those of the message changed."""
        frame_id = memory.database[self.message].frame_id
        arriving: list[Frame] = []
        for frame in frames:
            if frame.frame_id == frame_id:
                arriving += self.change(frame, active, memory)
            else:
                arriving.append(frame)
        return arriving

    @abstractmethod
    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """What arrives in place of one frame of the message."""


@strict
@dataclass(frozen=True, kw_only=True)
class MessageLost(MessageFault):
    """Frames do not arrive."""

    kind: Literal["message-lost"]

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """No frame while the fault acts."""
        return [] if active else [frame]


@strict
@dataclass(frozen=True, kw_only=True)
class MessageDelayed(MessageFault):
    """Frames arrive some periods late, in order; at the end the queue arrives at once."""

    kind: Literal["message-delayed"]
    delay_periods: Annotated[int, Ge(1), Le(1000)]

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """The frame of delay_periods ago; at the end all that still wait."""
        memory.kept.append(frame)
        waiting = self.delay_periods if active else 0
        arriving = memory.kept[: max(0, len(memory.kept) - waiting)]
        del memory.kept[: len(arriving)]
        return arriving


@strict
@dataclass(frozen=True, kw_only=True)
class MessageRepeated(MessageFault):
    """Each frame arrives again, directly after itself."""

    kind: Literal["message-repeated"]
    copies: Annotated[int, Ge(1), Le(100)] = 1

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """The frame and, while the fault acts, its copies after it."""
        return [frame] * (1 + self.copies) if active else [frame]


@strict
@dataclass(frozen=True, kw_only=True)
class MessageFrozen(MessageFault):
    """The last frame from before arrives in place of each new one."""

    kind: Literal["message-frozen"]

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """The last frame from before the fault."""
        if not (active and memory.kept):
            memory.kept = [frame]
        return list(memory.kept)


@strict
@dataclass(frozen=True, kw_only=True)
class MessageReordered(MessageFault):
    """Two frames at a time swap: the earlier one arrives after the later one."""

    kind: Literal["message-reordered"]

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """Nothing for the first of a pair, and the pair in reverse order for the second."""
        if memory.kept:
            return [frame, memory.kept.pop()]
        if not active:
            return [frame]
        memory.kept = [frame]
        return []


@strict
@dataclass(frozen=True, kw_only=True)
class ByteCorrupted(MessageFault):
    """Bits of one byte are inverted."""

    kind: Literal["byte-corrupted"]
    byte: Annotated[int, Ge(0), Le(MAX_DATA_LENGTH - 1)]
    mask: Annotated[int, Ge(1), Le(0xFF)] = 0xFF

    @property
    def where(self) -> str:
        """Name of the message and number of the byte."""
        return f"{self.message} byte {self.byte}"

    def check(self, database: Mapping[str, MessageCodec]) -> None:
        """Raise InputError when the message is too short to have that byte."""
        length = database[self.message].length
        if self.byte >= length:
            raise InputError(f"byte: {self.message} has {length} bytes; give 0 to {length - 1}")

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """The frame with the byte changed."""
        if not active:
            return [frame]
        data = bytearray(frame.data)
        data[self.byte] ^= self.mask
        return [frame._replace(data=bytes(data))]


@strict
@dataclass(frozen=True, kw_only=True)
class WrongId(MessageFault):
    """Frames carry another identifier, perhaps that of another message."""

    kind: Literal["message-wrong-id"]
    frame_id: Annotated[int, Ge(0), Le(HIGHEST_STANDARD_ID)]

    def check(self, database: Mapping[str, MessageCodec]) -> None:
        """Raise InputError for the own identifier, and for SYNC, which is the clock."""
        if self.frame_id in (database[self.message].frame_id, database[Message.SYNC].frame_id):
            raise InputError(
                f"frame_id: {self.frame_id:#x} is the identifier of {self.message} or SYNC; "
                "give another one"
            )

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """The frame under the other identifier."""
        return [frame._replace(frame_id=self.frame_id)] if active else [frame]


@strict
@dataclass(frozen=True, kw_only=True)
class WrongLength(MessageFault):
    """Frames are cut off, or continued with zeros."""

    kind: Literal["message-wrong-length"]
    length: Annotated[int, Ge(0), Le(MAX_DATA_LENGTH)]

    def check(self, database: Mapping[str, MessageCodec]) -> None:
        """Raise InputError when the length is the right one."""
        if self.length == database[self.message].length:
            raise InputError(f"length: {self.length} is right for {self.message}; give another one")

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """The frame with the other length."""
        if not active:
            return [frame]
        return [frame._replace(data=frame.data[: self.length].ljust(self.length, b"\0"))]


@strict
@dataclass(frozen=True, kw_only=True)
class Masquerade(MessageFault):
    """Somebody sends new content under a valid CRC, but with a counter that stands still."""

    kind: Literal["message-masqueraded"]

    def check(self, database: Mapping[str, MessageCodec]) -> None:
        """Raise InputError for a message without a counter."""
        if not database[self.message].data_ids:
            raise InputError(f"message: {self.message} is not protected; give one that is")

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """The frame with the last counter from before and its CRC."""
        if not (active and memory.kept):
            memory.kept = [frame]
            return [frame]
        counter = MessageCodec.counter(memory.kept[0].data)
        data = bytearray(frame.data)
        data[1] += counter - data[1] % COUNTER_MODULUS
        data[0] = profile2_crc(data, memory.database[self.message].data_ids[counter])
        return [frame._replace(data=bytes(data))]


@strict
@dataclass(frozen=True, kw_only=True)
class MessageContested(MessageFault):
    """Somebody else sends the message as well, with one signal changed and all else right.

    Its counter runs: with the true frame's where it comes ahead of it, one further where behind.
    """

    kind: Literal["message-contested"]
    signal: str
    value: float
    position: Literal["ahead", "behind"] = "behind"

    def check(self, database: Mapping[str, MessageCodec]) -> None:
        """Raise InputError for a message without a counter, and for a signal that it has not."""
        codec = database[self.message]
        if not codec.data_ids:
            raise InputError(f"message: {self.message} is not protected; give one that is")
        if self.signal not in codec.signal_names:
            raise InputError(
                f"signal: {self.message} has no signal {self.signal!r}; give one of "
                f"{', '.join(codec.signal_names)}"
            )

    def change(self, frame: Frame, active: bool, memory: FrameMemory) -> list[Frame]:
        """The frame and, ahead of it or behind, that of somebody else."""
        codec = memory.database[self.message]
        values = codec.decode(frame.data) if active else None
        if values is None:
            return [frame]
        steps = 1 if self.position == "behind" else 0
        counter = (codec.counter(frame.data) + steps) % COUNTER_MODULUS
        other = frame._replace(data=codec.encode({**values, self.signal: self.value}, counter))
        return [frame, other] if self.position == "behind" else [other, frame]


@strict
@dataclass(frozen=True, kw_only=True)
class BusOff(FrameFault):
    """No frame passes, in either direction."""

    kind: Literal["bus-off"]

    def apply(self, frames: list[Frame], active: bool, memory: FrameMemory) -> list[Frame]:
        """While the fault acts, SYNC and no other frame."""
        sync_id = memory.database[Message.SYNC].frame_id
        return [frame for frame in frames if not active or frame.frame_id == sync_id]


@strict
@dataclass(frozen=True, kw_only=True)
class Flood(FrameFault):
    """Foreign frames with random identifiers, lengths and content among those of the plant.

    400 frames in 0.1 s fill a bus of 500 kbit/s.
    """

    kind: Literal["bus-flood"]
    frames_per_period: Annotated[int, Ge(1), Le(5000)] = 400
    position: Literal["before", "between", "after"] = "between"

    hits_what_ecu_sends = False

    @property
    def where(self) -> str:
        """The bus, and where in the period the foreign frames come."""
        return f"bus, {self.position} the messages"

    def apply(self, frames: list[Frame], active: bool, memory: FrameMemory) -> list[Frame]:
        """The plant's frames in their order, and foreign ones."""
        if not active:
            return frames
        foreign = self._foreign(memory)
        if self.position == "before":
            return foreign + frames
        if self.position == "after":
            return frames + foreign
        gaps = max(1, len(frames) - 1)
        arriving = frames[:1]
        for number, frame in enumerate(frames[1:]):
            share = slice(number * len(foreign) // gaps, (number + 1) * len(foreign) // gaps)
            arriving += [*foreign[share], frame]
        return arriving

    def _foreign(self, memory: FrameMemory) -> list[Frame]:
        known = {codec.frame_id for codec in memory.database.values()}
        free = [frame_id for frame_id in range(HIGHEST_STANDARD_ID + 1) if frame_id not in known]
        rng, count = memory.rng, self.frames_per_period
        ids = rng.integers(len(free), size=count).tolist()
        lengths = rng.integers(MAX_DATA_LENGTH + 1, size=count).tolist()
        noise = rng.bytes(MAX_DATA_LENGTH * count)
        return [
            Frame(free[ids[i]], noise[MAX_DATA_LENGTH * i :][: lengths[i]]) for i in range(count)
        ]


FRAME_FAULTS = (
    MessageLost,
    MessageDelayed,
    MessageRepeated,
    MessageFrozen,
    MessageReordered,
    ByteCorrupted,
    WrongId,
    WrongLength,
    Masquerade,
    MessageContested,
    BusOff,
    Flood,
)
