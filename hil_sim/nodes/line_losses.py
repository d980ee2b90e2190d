"""What an ECU at the end of a serial line reports as lost on that line."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from hil_sim.bus.buses import CanBus, Frame
from hil_sim.bus.deadline import Deadline

LOSS_ID = 0x7F0
"""Of SLCAN_LINK_LOSS_ID in firmware_c/port/slcan_link.h, which explains the frame."""
_LATE_S = 0.05
"""A line that is quiet for as long has said everything."""
_LATEST_S = 5.0
_COUNTS = struct.Struct("<II")


@dataclass(frozen=True)
class LineLosses:
    """Frames lost since the ECU's start for want of room: on the way to it, and from it."""

    to_ecu: int = 0
    from_ecu: int = 0

    @property
    def total(self) -> int:
        """Frames lost in both directions together."""
        return self.to_ecu + self.from_ecu

    def __str__(self) -> str:
        return f"the ECU's serial line lost {self.to_ecu} frames to it and {self.from_ecu} from it"


class LossWatch:
    """Notes the latest report among the frames that it passes on."""

    def __init__(self) -> None:
        self.losses = LineLosses()

    def pass_on(self, frames: list[Frame]) -> list[Frame]:
        """The frames unchanged, after a look for a report of losses among them."""
        for frame_id, data in frames:
            if frame_id == LOSS_ID and len(data) == _COUNTS.size:
                self.losses = LineLosses(*_COUNTS.unpack(data))
        return frames

    def hear_out(self, bus: CanBus) -> None:
        """Take in what was said after the last answer."""
        deadline = Deadline(_LATEST_S)
        while (frame := bus.receive(min(_LATE_S, deadline.left_s))) is not None:
            self.pass_on([frame])
            if deadline.left_s == 0.0:
                return
