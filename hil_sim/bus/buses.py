"""CAN buses by name, `interface:channel` in python-can's terms, carrying classical data frames."""

from __future__ import annotations

import logging
import shlex
import time
from collections import Counter, deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can

from bms.errors import BusError, InputError
from hil_sim.bus.batches import BatchBus, SocketcanBatchBus, VirtualBatchBus, heard_of
from hil_sim.bus.closing import Closing
from hil_sim.bus.deadline import Deadline
from hil_sim.bus.foreign import ForeignFrame, is_unreadable
from hil_sim.bus.frame import Frame
from hil_sim.bus.multicast import keep_to_own_group
from hil_sim.bus.slcan import SCHEME, SlcanSocketBus

__all__ = [
    "GUEST",
    "CanBus",
    "Frame",
    "ecu_remedy",
    "heard_on",
    "is_serial_line",
    "next_heard",
    "one_line",
    "open_bus",
    "open_interface",
    "require_room_for_ecu",
    "require_shared",
]

GUEST = Path(__file__).with_name("vcan_guest.sh")
"""Runs a command where vcan0 exists, also on a kernel without CAN."""
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

_BATCH_BUSES: dict[str, Callable[..., can.BusABC]] = {
    "virtual": VirtualBatchBus,
    "socketcan": SocketcanBatchBus,
}

# What an adapter has to say when it cannot be opened is in the exception already.
logging.getLogger("can").addHandler(logging.NullHandler())


class CanBus(Closing):
    """An open bus; frames other than classical 11-bit data frames are counted and skipped."""

    def __init__(
        self, name: str, bus: can.BusABC, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self.name = name
        self._bus = bus
        self._batches = bus if isinstance(bus, BatchBus) else None
        self._clock_s = clock_s
        self._waiting = deque[Frame]()
        self.foreign = Counter[ForeignFrame]()
        """What came of other kinds, as far as the interface hands it over."""

    def send(self, *frames: Frame) -> None:
        """Put frames on the bus in order; BusError when the bus does not take them."""
        try:
            if self._batches is not None:
                self._batches.send_frames(frames)
                return
            for frame_id, data in frames:
                self._bus.send(
                    can.Message(arbitration_id=frame_id, data=data, is_extended_id=False)
                )
        except (can.CanError, OSError) as error:
            raise BusError(f"bus '{self.name}': cannot send: {one_line(error)}") from None

    def receive(self, timeout_s: float) -> Frame | None:
        """The next frame of another party, or None after timeout_s; BusError when the bus fails.

        Foreign frames do not prolong the wait.
        """
        waiting = self._waiting
        if waiting:
            return waiting.popleft()
        deadline = Deadline(timeout_s, self._clock_s)
        late = 0
        while late < _MOST_LATE_FOREIGN:
            left_s = deadline.left_s
            heard = self._hear(left_s)
            if not heard:
                return None
            frames = [one for one in heard if not isinstance(one, ForeignFrame)]
            if len(frames) != len(heard):
                foreign = [one for one in heard if isinstance(one, ForeignFrame)]
                self.foreign.update(foreign)
                late += len(foreign) if left_s == 0.0 else 0
            if frames:
                waiting.extend(frames)
                return waiting.popleft()
        return None

    def gather(
        self, last_id: int, is_last: Callable[[Frame], bool], timeout_s: float, most: int
    ) -> list[Frame]:
        """Frames up to one of last_id that `is_last`, or what has come within timeout_s.

        Never more than `most`, so that a stream of others ends the wait.
        """
        frames, waiting = list[Frame](), self._waiting
        deadline = Deadline(timeout_s, self._clock_s)
        while len(frames) < most:
            frame = waiting.popleft() if waiting else self.receive(deadline.left_s)
            if frame is None:
                break
            frames.append(frame)
            if frame[0] == last_id and is_last(frame):
                break
        return frames

    def _hear(self, timeout_s: float) -> list[Frame | ForeignFrame]:
        return heard_on(self.name, self._bus, self._batches, timeout_s)

    def close(self) -> None:
        """Close the connection to the bus."""
        self._bus.shutdown()


def heard_on(
    name: str, bus: can.BusABC, batches: BatchBus | None, timeout_s: float
) -> list[Frame | ForeignFrame]:
    """What has come from a bus, after a wait of up to timeout_s for the first; empty without any.

    All of it where the bus is one of batches, else one at a time. BusError when the bus fails.
    """
    if batches is None:
        heard = next_heard(name, bus, timeout_s)
        return [] if heard is None else [heard]
    try:
        return batches.hear(timeout_s)
    except (can.CanError, OSError) as error:
        raise BusError(f"bus '{name}': cannot receive: {one_line(error)}") from None


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
    return None if message is None else heard_of(message)


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
        if interface in _BATCH_BUSES:
            return _BATCH_BUSES[interface](channel, **options)
        bus = can.Bus(
            interface=interface,
            channel=channel,
            ignore_config=True,
            **{**_QUIRKS.get(interface, {}), **options},
        )
        if interface == "udp_multicast":
            keep_to_own_group(bus)
        return bus
    except Exception as error:  # every adapter behind python-can has exceptions of its own
        raise BusError(
            f"bus '{name}': cannot be opened ({one_line(error)}); {_remedy(interface)}"
        ) from None


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
