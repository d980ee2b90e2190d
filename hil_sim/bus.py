"""CAN buses by name, `interface:channel` in python-can's terms, carrying classical data frames."""

from __future__ import annotations

import copy
import logging
import socket
from types import TracebackType
from typing import Any, NamedTuple

import can
from can.interfaces.socketcan import SocketcanBus

from bms.errors import BusError, InputError

RECEIVE_BUFFER_BYTES = 1 << 20
_STANDARD_FRAMES = [{"can_id": 0, "can_mask": 0, "extended": False}]

# udp_multicast: one hop more would send the frames out of the machine's network card.
# slcan: a socket needs none of the start-up time of an adapter with a boot loader.
_QUIRKS: dict[str, dict[str, Any]] = {
    "udp_multicast": {"hop_limit": 0},
    "slcan": {"sleep_after_open": 0.0, "timeout": 0.001, "bitrate": 500_000},
}

# What an adapter has to say when it cannot be opened is in the exception already.
logging.getLogger("can").addHandler(logging.NullHandler())


class Frame(NamedTuple):
    """A data frame with an 11-bit identifier."""

    frame_id: int
    data: bytes


class _Message(can.Message):
    """A message whose deep copy, which the virtual bus makes for every receiver, is cheap."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, Any] | None) -> can.Message:
        return copy.copy(self)


class CanBus:
    """An open bus; frames other than classical 11-bit data frames are not seen."""

    def __init__(self, name: str, bus: can.BusABC) -> None:
        self.name = name
        self._bus = bus

    def send(self, frame: Frame) -> None:
        """Put a frame on the bus; BusError when the bus does not take it."""
        message = _Message(arbitration_id=frame.frame_id, data=frame.data, is_extended_id=False)
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            raise BusError(f"bus '{self.name}': cannot send: {_one_line(error)}") from None

    def receive(self, timeout_s: float) -> Frame | None:
        """The next frame of another party, or None after timeout_s; BusError when the bus fails."""
        try:
            while (message := self._bus.recv(timeout_s)) is not None:
                if not (message.is_remote_frame or message.is_error_frame or message.is_fd):
                    return Frame(message.arbitration_id, bytes(message.data))
        except (can.CanError, OSError) as error:
            raise BusError(f"bus '{self.name}': cannot receive: {_one_line(error)}") from None
        return None

    def __enter__(self) -> CanBus:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._bus.shutdown()


def open_bus(name: str) -> CanBus:
    """Open a bus such as virtual:bms, socketcan:vcan0 or slcan:socket://127.0.0.1:5000.

    Raises BusError in one line with a remedy when the name or the bus behind it is no good.
    """
    interface, colon, channel = name.partition(":")
    if not (colon and interface and channel):
        raise BusError(f"bus '{name}': not interface:channel; write for example virtual:bms")
    try:
        bus = can.Bus(
            interface=interface,
            channel=channel,
            can_filters=_STANDARD_FRAMES,
            ignore_config=True,
            **_QUIRKS.get(interface, {}),
        )
    except Exception as error:  # every adapter behind python-can has exceptions of its own
        raise BusError(
            f"bus '{name}': cannot be opened ({_one_line(error)}); {_remedy(interface)}"
        ) from None
    if isinstance(bus, SocketcanBus):
        bus.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    return CanBus(name, bus)


def require_shared(name: str) -> None:
    """Raise InputError for a bus on which only parties in one process can meet."""
    if name.startswith("virtual:"):
        raise InputError(
            f"bus '{name}': reaches parties in one process only; use 'bms sil', "
            "or a bus such as socketcan:vcan0 for two processes"
        )


def _remedy(interface: str) -> str:
    if interface == "socketcan":
        return (
            "use virtual:bms, or run the command inside tools/vcan_guest.sh, "
            "which provides socketcan:vcan0"
        )
    if interface not in can.VALID_INTERFACES:
        return "choose an interface that python-can knows, for example virtual:bms"
    return "check that the adapter is there and its driver installed, or use virtual:bms"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
