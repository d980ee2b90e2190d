"""A bus that is only listened to: there is no way to send."""

from __future__ import annotations

import socket
from collections import deque
from typing import Any

from can.interfaces.socketcan import SocketcanBus

from hil_sim.bus.batches import BatchBus
from hil_sim.bus.buses import Frame, heard_on, open_interface
from hil_sim.bus.closing import Closing
from hil_sim.bus.foreign import ForeignFrame

_RECEIVE_BUFFER_BYTES = 4 << 20

# slcan: the adapter then does not even acknowledge frames.
# socketcan: CAN FD frames are not delivered unless asked for.
_OPTIONS: dict[str, dict[str, Any]] = {"slcan": {"listen_only": True}, "socketcan": {"fd": True}}


class Listener(Closing):
    """Receives every frame of a bus, also the kinds that the nodes do not see."""

    def __init__(self, name: str) -> None:
        """Open the bus; BusError in one line when that cannot be done."""
        self.name = name
        self._bus = open_interface(name, **_OPTIONS.get(name.partition(":")[0], {}))
        self._batches = self._bus if isinstance(self._bus, BatchBus) else None
        if isinstance(self._bus, SocketcanBus):
            # Drawing takes long where the processor is slow; as much as the system allows.
            option = socket.SO_RCVBUF
            self._bus.socket.setsockopt(socket.SOL_SOCKET, option, _RECEIVE_BUFFER_BYTES)
        self._waiting = deque[Frame | ForeignFrame]()

    def receive(self, timeout_s: float) -> Frame | ForeignFrame | None:
        """The next frame, or None after timeout_s; BusError when the bus fails."""
        if not self._waiting:
            self._waiting += heard_on(self.name, self._bus, self._batches, timeout_s)
        return self._waiting.popleft() if self._waiting else None

    def close(self) -> None:
        """Close the connection to the bus."""
        self._bus.shutdown()
