"""The ECU node steps once for each SYNC, answers, and ends when the bus falls silent."""

import pytest

from hil_sim.bus.buses import Frame, open_bus
from hil_sim.bus.catalog import FrameId
from hil_sim.nodes.ecu import EcuNode

SYNC = Frame(FrameId.SYNC, b"")
POLL_S = 0.01


class EchoEcu:
    """Answers a step with the frames received since the last one, then the number of the step."""

    def __init__(self):
        self.steps = 0
        self.pending = []

    def receive(self, frame_id, data):
        self.pending.append((frame_id, data))

    def step(self):
        self.steps += 1

    def transmit(self):
        frames, self.pending = self.pending, []
        return [*frames, (0x180, bytes([self.steps]))]


class SteppedClock:
    """Time that moves when the node looks at it."""

    def __init__(self, tick_s):
        self.time_s = 0.0
        self.tick_s = tick_s

    def now_s(self):
        self.time_s += self.tick_s
        return self.time_s

    def sleep_until_s(self, time_s):
        self.time_s = max(self.time_s, time_s)


@pytest.fixture
def connected(request):
    name = f"virtual:{request.node.name}"
    with open_bus(name) as plant, open_bus(name) as bus:
        yield plant, EcuNode(bus, EchoEcu())


def received(bus):
    frames = []
    while (frame := bus.receive(0.0)) is not None:
        frames.append(frame)
    return frames


def test_sync_is_the_identifier_of_the_database(database):
    assert database["SYNC"].frame_id == FrameId.SYNC


def test_it_steps_once_for_each_sync_after_all_that_came_before(connected):
    plant, node = connected
    for frame in (Frame(0x100, b"a"), Frame(0x101, b"b"), SYNC, Frame(0x100, b"c"), SYNC):
        plant.send(frame)
    assert node.answer(POLL_S)
    assert received(plant) == [(0x100, b"a"), (0x101, b"b"), SYNC, (0x180, b"\x01")]
    assert node.answer(POLL_S)
    assert received(plant) == [(0x100, b"c"), SYNC, (0x180, b"\x02")]
    assert (node.frames, node.steps) == (5, 2)


def test_without_sync_it_does_not_step(connected):
    plant, node = connected
    plant.send(Frame(0x100, b"a"))
    assert not node.answer(POLL_S)
    assert node.steps == 0
    assert received(plant) == []


def test_what_was_on_the_bus_before_it_listened_is_left_alone(connected):
    """A period heard from its middle would be a period with missing measurements."""
    plant, node = connected
    plant.send(Frame(0x101, b"second half of a period"))
    plant.send(SYNC)
    polls = iter(range(100))
    node.run(silence_s=100.0, stopped=lambda: next(polls) > 3, poll_s=POLL_S)
    assert (node.frames, node.steps) == (0, 0)


def test_run_waits_for_a_first_frame_and_ends_in_silence(connected):
    plant, node = connected
    idle = iter(range(1000))

    def stopped():
        if next(idle) == 20:
            plant.send(SYNC)
        return False

    node.run(silence_s=5 * POLL_S, stopped=stopped, poll_s=POLL_S)
    assert node.steps == 1
    assert 20 < next(idle) < 40


def test_run_ends_when_it_is_stopped(connected):
    _, node = connected
    node.run(silence_s=100.0, stopped=lambda: True, poll_s=POLL_S)
    assert node.steps == 0


def test_run_ends_when_it_is_stopped_on_a_bus_that_is_never_silent(connected):
    plant, node = connected
    talk = iter([Frame(0x700, b"foreign")] * 200)
    looks = iter(range(1000))

    class Prompted(EchoEcu):
        def receive(self, frame_id, data):
            if (frame := next(talk, None)) is not None:
                plant.send(frame)

    def stopped():
        look = next(looks)
        if look == 0:
            plant.send(next(talk))
        return look >= 20

    node._ecu = Prompted()
    node.run(silence_s=100.0, stopped=stopped, poll_s=POLL_S)
    assert (node.frames, node.steps) == (20, 0)


def test_on_its_own_clock_it_steps_each_period_without_sync(connected):
    plant, node = connected
    plant.send(Frame(0x100, b"a"))
    node.run_on_clock(0.1, SteppedClock(0.02), silence_s=1.0, stopped=lambda: False)
    answers = received(plant)
    assert answers[:2] == [(0x100, b"a"), (0x180, b"\x01")]
    assert node.steps == len([frame for frame in answers if frame.frame_id == 0x180])
    assert 9 <= node.steps <= 11
