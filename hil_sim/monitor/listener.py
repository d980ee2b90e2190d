"""A bus that is only listened to: there is no way to send."""

from __future__ import annotations

from enum import Enum
from typing import Any

import can

from bms.errors import BusError
from hil_sim.bus.buses import Frame, one_line, open_interface
from hil_sim.bus.closing import Closing

# slcan: the adapter then does not even acknowledge frames.
# socketcan: CAN FD frames are not delivered unless asked for.
_OPTIONS: dict[str, dict[str, Any]] = {"slcan": {"listen_only": True}, "socketcan": {"fd": True}}


class ForeignFrame(Enum):
    """Kinds of frames that no node of this project sends or takes."""

    EXTENDED = "extended"
    REMOTE = "remote"
    ERROR = "error"
    FD = "FD"


class Listener(Closing):
    """Receives every frame of a bus, also the kinds that the nodes do not see."""

    def __init__(self, name: str) -> None:
        """Open the bus; BusError in one line when that cannot be done."""
        self.name = name
        self._bus = open_interface(name, **_OPTIONS.get(name.partition(":")[0], {}))

    def receive(self, timeout_s: float) -> Frame | ForeignFrame | None:
        """The next frame, or None after timeout_s; BusError when the bus fails."""
        try:
            message = self._bus.recv(timeout_s)
        except (can.CanError, OSError) as error:
            raise BusError(f"bus '{self.name}': cannot receive: {one_line(error)}") from None
        return None if message is None else _classified(message)

    def close(self) -> None:
        """Close the connection to the bus."""
        self._bus.shutdown()


def _classified(message: can.Message) -> Frame | ForeignFrame:
    if message.is_error_frame:
        return ForeignFrame.ERROR
    if message.is_fd:
        return ForeignFrame.FD
    if message.is_remote_frame:
        return ForeignFrame.REMOTE
    if message.is_extended_id:
        return ForeignFrame.EXTENDED
    return Frame(message.arbitration_id, bytes(message.data))
