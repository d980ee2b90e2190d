"""CAN buses by name, `interface:channel` in python-can's terms, carrying classical data frames."""

from __future__ import annotations

import logging
import shlex
import socket
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import can
from can.interfaces.socketcan import SocketcanBus

from bms.errors import BusError, InputError
from hil_sim.bus.closing import Closing
from hil_sim.bus.deadline import Deadline
from hil_sim.bus.foreign import ForeignFrame, foreign_kind, is_unreadable
from hil_sim.bus.slcan import SCHEME, SlcanSocketBus

GUEST = Path(__file__).with_name("vcan_guest.sh")
"""Runs a command where vcan0 exists, also on a kernel without CAN."""
RECEIVE_BUFFER_BYTES = 1 << 20
_STANDARD_FRAMES = [{"can_id": 0, "can_mask": 0, "extended": False}]
_MOST_LATE_FOREIGN = 1000
"""Foreign frames that are skipped after the deadline, for what came before it and waits behind."""

# udp_multicast: one hop more would send the frames out of the machine's network card.
# slcan: an adapter needs no start-up time unless it has a boot loader of its own.
_QUIRKS: dict[str, dict[str, Any]] = {
    "udp_multicast": {"hop_limit": 0},
    "slcan": {"sleep_after_open": 0.0, "timeout": 0.001, "bitrate": 500_000},
}
# The kernel keeps extended frames from the nodes. Elsewhere python-can would filter, and takes a
# foreign frame for the end of a wait of 0 s.
_NODE_OPTIONS: dict[str, dict[str, Any]] = {"socketcan": {"can_filters": _STANDARD_FRAMES}}

# What an adapter has to say when it cannot be opened is in the exception already.
logging.getLogger("can").addHandler(logging.NullHandler())


class Frame(NamedTuple):
    """A data frame with an 11-bit identifier."""

    frame_id: int
    data: bytes


class _Message(can.Message):
    """A message that nobody changes, so that the virtual bus needs no copy for every receiver."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, Any] | None) -> can.Message:
        return self


class CanBus(Closing):
    """An open bus; frames other than classical 11-bit data frames are counted and skipped."""

    def __init__(
        self, name: str, bus: can.BusABC, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self.name = name
        self._bus = bus
        self._clock_s = clock_s
        self.foreign = Counter[ForeignFrame]()
        """What came of other kinds, as far as the interface hands it over."""

    def send(self, frame: Frame) -> None:
        """Put a frame on the bus; BusError when the bus does not take it."""
        message = _Message(arbitration_id=frame.frame_id, data=frame.data, is_extended_id=False)
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            raise BusError(f"bus '{self.name}': cannot send: {one_line(error)}") from None

    def receive(self, timeout_s: float) -> Frame | None:
        """The next frame of another party, or None after timeout_s; BusError when the bus fails.

        Foreign frames do not prolong the wait.
        """
        deadline = Deadline(timeout_s, self._clock_s)
        late = 0
        while late < _MOST_LATE_FOREIGN:
            left_s = deadline.left_s
            heard = next_heard(self.name, self._bus, left_s)
            if not isinstance(heard, ForeignFrame):
                return heard
            self.foreign[heard] += 1
            late += left_s == 0.0
        return None

    def close(self) -> None:
        """Close the connection to the bus."""
        self._bus.shutdown()


def next_heard(name: str, bus: can.BusABC, timeout_s: float) -> Frame | ForeignFrame | None:
    """What comes next from a bus, or None after timeout_s; BusError when the bus fails.

    One datagram or line that is no frame does not end a node.
    """
    try:
        message = bus.recv(timeout_s)
    except (can.CanError, OSError, ValueError, LookupError) as error:
        if is_unreadable(error):
            return ForeignFrame.UNREADABLE
        raise BusError(f"bus '{name}': cannot receive: {one_line(error)}") from None
    if message is None:
        return None
    return foreign_kind(message) or Frame(message.arbitration_id, bytes(message.data))


def open_bus(name: str) -> CanBus:
    """Open a bus such as virtual:bms, socketcan:vcan0 or slcan:socket://127.0.0.1:5000.

    Raises BusError in one line with a remedy when the name or the bus behind it is no good.
    """
    options = _NODE_OPTIONS.get(name.partition(":")[0], {})
    return CanBus(name, open_interface(name, **options))


def open_interface(name: str, **options: Any) -> can.BusABC:
    """python-can's bus of that name, with these options of its own; BusError as in open_bus."""
    interface, colon, channel = name.partition(":")
    if not (colon and interface and channel):
        raise BusError(f"bus '{name}': not interface:channel; write for example virtual:bms")
    try:
        if interface == "slcan" and channel.startswith(SCHEME):
            return SlcanSocketBus(channel, **options)
        bus = can.Bus(
            interface=interface,
            channel=channel,
            ignore_config=True,
            **{**_QUIRKS.get(interface, {}), **options},
        )
    except Exception as error:  # every adapter behind python-can has exceptions of its own
        raise BusError(
            f"bus '{name}': cannot be opened ({one_line(error)}); {_remedy(interface)}"
        ) from None
    if isinstance(bus, SocketcanBus):
        bus.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    return bus


def require_shared(name: str) -> None:
    """Raise InputError for a bus on which only parties in one process can meet."""
    if name.startswith("virtual:"):
        raise InputError(
            f"bus '{name}': reaches parties in one process only; use 'bms sil', "
            "or a bus such as socketcan:vcan0 for two processes"
        )


def is_serial_line(name: str) -> bool:
    """Whether the bus is a line with one end here, so that an ECU can only be at the other one."""
    return name.startswith(f"slcan:{SCHEME}")


def require_room_for_ecu(name: str) -> None:
    """Raise InputError for a line or an adapter, which plant and ECU cannot share."""
    if name.startswith("slcan:") and not is_serial_line(name):
        raise InputError(
            f"bus '{name}': one adapter is one party; use 'bms plant --bus BUS', and "
            "'bms ecu --bus BUS' or the ECU at another adapter, or a bus such as virtual:bms"
        )
    if is_serial_line(name):
        raise InputError(
            f"bus '{name}': has one end here, and the ECU is at the other; use 'bms sil' or "
            "'bms plant --bus BUS', or a bus such as virtual:bms"
        )


def ecu_remedy(name: str) -> str:
    """What to do when no ECU answers on a bus."""
    if is_serial_line(name):
        return (
            "see that an image with this firmware runs at its other end; "
            "'bms flash --image FILE --port PORT' starts one in QEMU"
        )
    return f"start 'bms ecu --bus {name}'"


def _remedy(interface: str) -> str:
    if interface == "socketcan":
        return (
            f"use virtual:bms, or run the command inside {shlex.quote(str(GUEST))}, "
            "which provides socketcan:vcan0"
        )
    if interface == "slcan":
        return "see that an image or adapter listens there, or use virtual:bms"
    if interface not in can.VALID_INTERFACES:
        return "choose an interface that python-can knows, for example virtual:bms"
    return "check that the adapter is there and its driver installed, or use virtual:bms"


def one_line(error: Exception) -> str:
    """What an exception says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__
