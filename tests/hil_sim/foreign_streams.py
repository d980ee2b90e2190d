"""Streams of what concerns nobody on a bus, and how long plant and ECU last beside them.

    python -m tests.hil_sim.foreign_streams BUS KIND...

prints as JSON, for each kind, the times in s of `endings`.
"""

from __future__ import annotations

import json
import socket
import struct
import sys
import time
from threading import Event, Thread

import can

from bms.errors import BusError
from bms.presets import load_preset
from hil_sim.bus.buses import Frame, open_bus, open_interface
from hil_sim.bus.catalog import FrameId
from hil_sim.bus.closing import Closing
from hil_sim.nodes.ecu import EcuNode
from hil_sim.run.session import run_plant
from hil_sim.run.settings import Settings

GAP_S = 0.004
STREAM_S = 30.0
"""Longer than any test waits: what ends only with the stream is seen."""
ANSWER_TIMEOUT_S = 0.05
SILENCE_S = 0.4

MESSAGES = {
    "extended": can.Message(arbitration_id=0x100, is_extended_id=True, data=[1]),
    "remote": can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True, dlc=4),
    "error": can.Message(arbitration_id=0x04, is_error_frame=True, is_extended_id=False, dlc=8),
    "FD": can.Message(arbitration_id=0x100, is_extended_id=False, is_fd=True, data=[1] * 12),
    "other": can.Message(arbitration_id=0x7FF, is_extended_id=False, data=[1]),
}
"""By kind; `other` are data frames of somebody else."""
DATAGRAMS = {
    "garbage": b"\xc1hello",
    "empty": b"",
    "text": b"M-SEARCH * HTTP/1.1\r\n",
    "number": b"\x07",
    "map": b"\x81\xa1x\x01",
    "cut": b"\xde",
}
"""What is no frame, by name, for udp_multicast."""
UDP_PORT = 43113


class Stream(Closing):
    """Sends something every GAP_S until it is closed."""

    def __init__(self, bus: str, kind: str) -> None:
        self._stop = Event()
        self._bus = None
        if kind in MESSAGES:
            options = {"fd": True} if bus.startswith("socketcan") else {}
            self._bus = open_interface(bus, **options)
        send = self._message if self._bus is not None else self._datagram
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, struct.pack("@I", 0))
        self._address = (bus.partition(":")[2], UDP_PORT)
        self._thread = Thread(target=self._run, args=(send, kind), daemon=True)
        self._thread.start()

    def _message(self, kind: str) -> None:
        self._bus.send(MESSAGES[kind])

    def _datagram(self, kind: str) -> None:
        self._socket.sendto(DATAGRAMS[kind], self._address)

    def _run(self, send, kind: str) -> None:
        end_s = time.monotonic() + STREAM_S
        while time.monotonic() < end_s and not self._stop.wait(GAP_S):
            send(kind)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self._socket.close()
        if self._bus is not None:
            self._bus.shutdown()


class NoEcu:
    """Takes everything and says nothing."""

    def receive(self, frame_id, data):
        pass

    def step(self):
        pass

    def transmit(self):
        return ()


def plant_ends_s(bus: str) -> float:
    """Time after which a plant says that no ECU is there."""
    start_s = time.monotonic()
    settings = Settings(load_preset("paper_calibrated"), bus=bus, answer_timeout_s=ANSWER_TIMEOUT_S)
    try:
        run_plant(settings)
    except BusError as error:
        assert "no ECU answers" in str(error)
    return time.monotonic() - start_s


def ecu_ends_s(bus: str) -> float:
    """Time after which an ECU ends that has heard one SYNC."""
    with open_bus(bus) as own, open_bus(bus) as other:
        node = EcuNode(own, NoEcu())
        thread = Thread(target=node.run, args=(SILENCE_S, lambda: False), daemon=True)
        start_s = time.monotonic()
        thread.start()
        while not node.steps:
            other.send(Frame(FrameId.SYNC, b""))
            time.sleep(0.2)
        thread.join(STREAM_S)
        return time.monotonic() - start_s


def ecu_stops_s(bus: str) -> float:
    """Time after which an ECU ends that is told to stop."""
    stop = Event()
    with open_bus(bus) as own:
        node = EcuNode(own, NoEcu())
        thread = Thread(target=node.run, args=(1e9, stop.is_set), daemon=True)
        thread.start()
        time.sleep(0.2)
        stop.set()
        start_s = time.monotonic()
        thread.join(STREAM_S)
        return time.monotonic() - start_s


def endings(bus: str, kind: str) -> dict[str, float]:
    """The times in s beside a stream of a kind; data frames are no silence for an ECU."""
    with Stream(bus, kind):
        times_s = {"plant": plant_ends_s(bus), "stopped ECU": ecu_stops_s(bus)}
        if kind != "other":
            times_s["ECU"] = ecu_ends_s(bus)
    return times_s


if __name__ == "__main__":
    print(json.dumps({kind: endings(sys.argv[1], kind) for kind in sys.argv[2:]}))
