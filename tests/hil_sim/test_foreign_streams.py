"""A stream of foreign frames neither holds up a node nor ends it."""

from __future__ import annotations

import json
import os
import re
import sys
import time
from collections import Counter
from contextlib import nullcontext
from pathlib import Path

import can
import pytest

from bms.errors import BusError
from hil_sim.bus.buses import CanBus, Frame, open_bus
from hil_sim.bus.catalog import FrameId
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.monitor.listener import Listener
from hil_sim.nodes.ecu import EcuNode
from hil_sim.nodes.line_losses import LossWatch
from hil_sim.nodes.turns import LockStep
from hil_sim.targets.remote import RemoteEcu
from tests.examples.test_own_nodes import finished, our
from tests.hil_sim.foreign_streams import DATAGRAMS, GAP_S, MESSAGES, NoEcu, Stream, endings
from tests.hil_sim.test_vcan import HAS_GUEST, HAS_VCAN, MISSING, run_in_guest

FOREIGN = [kind for kind in MESSAGES if kind != "other"]
LONGEST_S = 10.0
"""All ends are due within 2 s; the machine may be busy, the stream goes on for 30 s."""


def group(number: int) -> str:
    """A multicast group, of those for local use, that no other run uses at the same time."""
    return f"udp_multicast:239.74.{90 + os.getpid() // 250 % 10}.{1 + (os.getpid() + number) % 250}"


class EndlessBus:
    """A bus of python-can on which the same comes every gap_s, by a clock of its own."""

    def __init__(self, message, gap_s):
        self.time_s = 0.0
        self._message, self._gap_s = message, gap_s
        self.shutdown = lambda: None

    def recv(self, timeout_s):
        self.time_s += min(timeout_s, self._gap_s)
        if isinstance(self._message, Exception):
            raise self._message
        return self._message if timeout_s >= self._gap_s else None


@pytest.mark.parametrize("gap_s", [0.0003, 0.05, 0.9])
@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_frame_does_not_prolong_a_wait(kind, gap_s):
    endless = EndlessBus(MESSAGES[kind], gap_s)
    bus = CanBus("endless", endless, clock_s=lambda: endless.time_s)
    assert bus.receive(1.0) is None
    assert endless.time_s == pytest.approx(1.0)
    assert bus.foreign == {ForeignFrame(kind): pytest.approx(1.0 / gap_s, abs=1.0)}


def test_what_waits_behind_foreign_frames_is_heard_after_the_deadline_too():
    with open_bus("virtual:behind") as bus, can.Bus("behind", interface="virtual") as other:
        for kind in FOREIGN:
            other.send(MESSAGES[kind])
        other.send(MESSAGES["other"])
        assert bus.receive(0.0) == Frame(0x7FF, b"\x01")
        assert bus.foreign == Counter(map(ForeignFrame, FOREIGN))


def test_a_flood_faster_than_it_can_be_read_ends_a_wait_too():
    endless = EndlessBus(MESSAGES["remote"], 0.0)
    assert CanBus("endless", endless, clock_s=lambda: endless.time_s).receive(0.0) is None


class EndlessTalk:
    """A bus of python-can on which a data frame of somebody else comes every GAP_S."""

    def recv(self, timeout_s):
        time.sleep(min(timeout_s, GAP_S))
        return MESSAGES["other"] if timeout_s >= GAP_S else None

    def send(self, message):
        pass


def Talk():
    return CanBus("talk", EndlessTalk())


@pytest.mark.parametrize(
    "wait",
    [
        lambda: list(LockStep(0.1, 0.1, None).answers(Talk(), 0, lambda frame: False)),
        lambda: EcuNode(Talk(), NoEcu()).answer(0.1),
        lambda: EcuNode(Talk(), NoEcu())._await_gap(0.01),
        lambda: LossWatch().hear_out(Talk()),
    ],
    ids=["plant", "ECU", "ECU that begins", "line"],
)
def test_data_frames_of_others_do_not_prolong_a_wait(wait, monkeypatch):
    monkeypatch.setattr("hil_sim.nodes.line_losses._LATEST_S", 0.1)
    start_s = time.monotonic()
    wait()
    assert time.monotonic() - start_s < 2.0


def test_an_ecu_elsewhere_that_does_not_answer_among_the_frames_of_others_is_silent(monkeypatch):
    monkeypatch.setattr("hil_sim.targets.remote._ANSWER_TIMEOUT_S", 0.1)
    with pytest.raises(BusError, match="no answer"):
        RemoteEcu(Talk(), FrameId.CHARGE_COMMAND).transmit()


@pytest.mark.parametrize("name", DATAGRAMS)
def test_a_datagram_that_is_no_frame_is_skipped_counted_and_told(name):
    bus = group(50 + list(DATAGRAMS).index(name))
    with open_bus(bus) as own, Listener(bus) as listener, open_bus(bus) as other:
        with Stream(bus, name):
            assert listener.receive(5.0) is ForeignFrame.UNREADABLE
        other.send(Frame(0x123, b"after"))
        assert own.receive(5.0) == Frame(0x123, b"after")
        assert list(own.foreign) == [ForeignFrame.UNREADABLE]


@pytest.mark.parametrize(
    ("error", "is_raised"),
    [
        (can.CanOperationError("the adapter is gone"), True),
        (OSError("the network is down"), True),
        (ValueError("invalid literal for int() with base 16: 'zz'"), False),
    ],
)
def test_a_bus_that_fails_is_not_taken_for_a_damaged_frame(error, is_raised):
    endless = EndlessBus(error, 0.1)
    bus = CanBus("failing", endless, clock_s=lambda: endless.time_s)
    with pytest.raises(BusError, match="cannot receive") if is_raised else nullcontext():
        assert bus.receive(1.0) is None


@pytest.mark.slow
def test_ecu_and_monitor_say_what_was_foreign():
    bus = group(70)
    with Stream(bus, "garbage"), open_bus(bus) as plant:
        monitor = our("monitor", "--bus", bus, "--for-s", 3)
        ecu = our("ecu", "--bus", bus, "--silence-s", 1)
        # The ECU waits for a first frame, after which it ends in silence.
        while ecu.poll() is None:
            plant.send(Frame(0x7FF, b""))
            time.sleep(1.5)
    code, printed, error = finished(ecu)
    assert (code, error) == (0, "")
    assert re.search(r"; foreign: \d+ unreadable$", printed.strip()), printed
    code, printed, error = finished(monitor)
    assert (code, error) == (0, "")
    assert re.search(r"; foreign [1-9]\d*;", printed.splitlines()[-2]), printed


@pytest.mark.parametrize("kind", [*MESSAGES, "garbage"])
def test_plant_and_ecu_end_in_time_beside_a_stream(kind):
    bus = group([*MESSAGES, *DATAGRAMS].index(kind))
    times_s = endings(bus, kind)
    assert max(times_s.values()) < LONGEST_S, times_s


@pytest.mark.slow
@pytest.mark.skipif(not (HAS_VCAN or HAS_GUEST or "CI" in os.environ), reason=MISSING)
def test_plant_and_ecu_end_in_time_beside_a_stream_on_a_real_vcan():
    command = (sys.executable, "-m", "tests.hil_sim.foreign_streams", "socketcan:vcan0", *MESSAGES)
    done = run_in_guest(*command, folder=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout.splitlines()[-1])
    assert list(seen) == list(MESSAGES)
    assert max(max(times_s.values()) for times_s in seen.values()) < LONGEST_S, seen
