"""Lateness, misses and latency of a real-time run against what a clock of known faults did."""

import json
import math
import statistics
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil_sim.bus.buses import CanBus, Frame
from hil_sim.bus.e2e import Sender
from hil_sim.nodes.ecu import MEASUREMENT_ID, PHASE_PERIODS, EcuNode
from hil_sim.nodes.plant import PlantNode, Request
from hil_sim.nodes.punctuality import Slots, TimeStatistics
from hil_sim.nodes.turns import LockStep, OnClock, PacedLockStep
from hil_sim.plant.sensors import Readings

READINGS = Readings(-1.0, 3.3, 300.0, 299.0, 1.0)
REQUEST = Request(charge=False, reference_current_A=-23.0, plug_in_soc=0.1)
PERIOD_S = 1.0
"""A period, like every time in these tests, that binary fractions hold exactly."""


class FaultyClock:
    """Sleeps end late by the given times in turn; nothing else takes time."""

    def __init__(self, oversleep_s=()):
        self.time_s = 1000.0
        self._oversleep_s = iter(oversleep_s)

    def now_s(self):
        return self.time_s

    def sleep_until_s(self, time_s):
        self.time_s = max(self.time_s, time_s) + next(self._oversleep_s, 0.0)


class TimedBus(CanBus):
    """Frames that arrive at given times of a clock; waiting for one lets the time pass."""

    def __init__(self, clock):
        super().__init__("timed", None, clock.now_s)
        self._clock = clock
        self.coming = []
        self.sent = []
        self.answer = lambda frame: None

    def send(self, *frames):
        for frame in frames:
            self.sent.append((self._clock.time_s, frame))
            self.answer(frame)

    def receive(self, timeout_s):
        end_s = self._clock.time_s + timeout_s
        if self.coming and self.coming[0][0] <= end_s:
            time_s, frame = self.coming.pop(0)
            self._clock.time_s = max(self._clock.time_s, time_s)
            return frame
        self._clock.time_s = end_s
        return None


class SilentEcu:
    def receive(self, frame_id, data):
        pass

    def step(self):
        pass

    def transmit(self):
        return []


def plant_run(database, oversleep_s, latency_s, make_turn=OnClock, periods=None):
    """Timing of a plant whose sleeps and whose ECU are late by those times, and its frames."""
    clock = FaultyClock(oversleep_s)
    bus, turn = TimedBus(clock), make_turn(PERIOD_S, clock)
    node = PlantNode(bus, database, turn)
    command, latencies = Sender(database["ChargeCommand"]), iter(latency_s)

    def answer(frame):
        late_s = next(latencies) if frame.frame_id == database["ChargeRequest"].frame_id else None
        if late_s is not None:
            bus.coming.append((clock.time_s + late_s, command.frame({"CommandCurrent": 0.0})))

    bus.answer = answer
    commanded = []
    for period in range(periods or len(latency_s)):
        node.wait()
        commanded.append(node.exchange(period, READINGS, REQUEST).command_A is not None)
    return turn.watch.timing(commanded), bus.sent


def assert_statistics(statistics_of_times, times_s):
    ranked = sorted(1000.0 * time_s for time_s in times_s)
    assert statistics_of_times.median_ms == pytest.approx(statistics.median(ranked))
    assert statistics_of_times.p99_ms == pytest.approx(
        ranked[math.ceil(Fraction(99, 100) * len(ranked)) - 1]
    )
    assert statistics_of_times.max_ms == ranked[-1]
    assert statistics_of_times.jitter_ms == pytest.approx(statistics.pstdev(ranked))


BELOW_A_PERIOD = st.integers(0, 99).map(lambda n: n / 128)


@given(st.lists(BELOW_A_PERIOD, min_size=1, max_size=250))
def test_a_spread_is_that_of_the_statistics_module(times_s):
    assert_statistics(TimeStatistics.of(times_s), times_s)


def test_of_no_times_there_is_no_spread():
    assert TimeStatistics.of([]) is None


@pytest.mark.parametrize("make_turn", [OnClock, lambda T, c: PacedLockStep(T, 0.25, None, c)])
def test_known_jitter_and_latency_come_out_as_they_went_in(database, make_turn):
    late_s = [n * 37 % 61 / 128 for n in range(200)]
    latency_s = [(20 + n * 11 % 7) / 128 for n in range(201)]
    timing, sent = plant_run(database, late_s, latency_s, make_turn)
    assert_statistics(timing.lateness, [0.0, *late_s])
    assert_statistics(timing.answer_latency, latency_s)
    assert (timing.periods, timing.missed_deadlines) == (201, 0)
    assert timing.periods_without_command == timing.longest_without_command_periods == 0
    assert (timing.period_ms, timing.deadline_ms) == (1000.0, 500.0)
    requests = [t for t, frame in sent if frame.frame_id == database["ChargeRequest"].frame_id]
    assert requests == [1000.0 + n + late for n, late in enumerate([0.0, *late_s])]


@given(st.integers(0, 48))
def test_a_stall_of_the_plant_counts_as_its_length_in_whole_periods(database, eighths):
    """The plant makes up for every period, and each that was late is one of them."""
    stall_s = eighths / 8
    timing, sent = plant_run(database, [0.0, 0.0, stall_s], [0.25] * 12)
    requests = [t for t, frame in sent if frame.frame_id == database["ChargeRequest"].frame_id]
    by_hand = sum(t - (1000.0 + n) >= 0.5 for n, t in enumerate(requests))
    assert timing.missed_deadlines == by_hand == math.floor(stall_s + 0.5)
    assert timing.lateness.max_ms == 1000.0 * stall_s


@given(st.integers(0, 48))
def test_a_stall_of_the_ecu_counts_the_same_and_leaves_its_phase(eighths):
    """The ECU leaves steps out instead, and goes on where it would have been."""
    stall_s = eighths / 8
    clock = FaultyClock([0.0, 0.0, stall_s])
    bus = TimedBus(clock)
    bus.coming = [(1000.25 + n, Frame(0x100, b"")) for n in range(20)]
    node = EcuNode(bus, SilentEcu())
    begun_s = []
    node._ecu.step = lambda: begun_s.append(clock.time_s)
    node.run_on_clock(PERIOD_S, clock, silence_s=2.0, stopped=lambda: clock.time_s >= 1014.75)
    assert node.slots.missed == math.floor(stall_s + 0.5)
    assert node.slots.skipped == math.floor(stall_s)
    assert max(node.slots.late_s) == stall_s % PERIOD_S
    assert node.slots.longest_stall_s == stall_s
    midway = [1000.75 + n for n in range(15)]
    assert begun_s[:2] == midway[:2]
    assert begun_s[2] == midway[2] + stall_s
    assert begun_s[3:] == [t for t in midway if t > begun_s[2]]


@pytest.mark.parametrize("first_s", [0.0, 0.25, -0.25])
@pytest.mark.parametrize("drift_s", [0.0, 2**-7, -(2**-7)])
def test_the_ecu_follows_the_plants_phase(first_s, drift_s):
    """A late or early first measurement, others up to a quarter period late, clocks that run apart,
    and foreign frames in between.
    """
    clock = FaultyClock()
    bus = TimedBus(clock)
    due_s = [1001.0 + n * (PERIOD_S + drift_s) for n in range(400)]
    late_s = [first_s, *(n * 37 % 61 / 256 for n in range(1, 400))]
    heard = [(due + late, Frame(MEASUREMENT_ID, b"")) for due, late in zip(due_s, late_s)]
    foreign = [(1001.375 + n * 0.5, Frame(0x700, b"")) for n in range(800)]
    bus.coming = sorted([*heard, *foreign])
    node = EcuNode(bus, SilentEcu())
    begun_s = []
    node._ecu.step = lambda: begun_s.append(clock.time_s)
    node.run_on_clock(PERIOD_S, clock, silence_s=2.0, stopped=lambda: clock.time_s >= 1390.0)
    gaps_s = [t - max(due for due in due_s if due <= t) for t in begun_s if t >= 1026.0]
    punctual_s = max(min(late_s[n : n + PHASE_PERIODS]) for n in range(1, 380))
    drifted_s = 2 * PHASE_PERIODS * abs(drift_s)  # a correction is up to two windows old
    assert max(abs(gap_s - 0.5) for gap_s in gaps_s) <= punctual_s + drifted_s + 1e-9
    assert node.slots.missed == node.slots.skipped == 0


def test_the_first_measurement_is_the_one_of_the_database(database):
    assert database["CellElectrical"].frame_id == MEASUREMENT_ID


@pytest.mark.parametrize(("late_s", "missed"), [(0.5 - 2**-20, 0), (0.5, 1), (1.0, 1)])
def test_half_a_period_late_is_too_late(late_s, missed):
    slots = Slots(PERIOD_S, 5.0)
    slots.begin(5.0 + late_s)
    assert slots.missed == missed


def test_periods_without_a_command_count_from_the_first_one_on(database):
    latency_s = [None, None, 0.25, None, 0.25, None, None, 0.25, 0.95, 0.25, None]
    timing, _ = plant_run(database, [], latency_s)
    assert timing.periods_without_command == 5
    assert timing.longest_without_command_periods == 2
    assert timing.answer_latency.max_ms == 250.0


def test_of_two_commands_in_a_period_the_first_counts(database):
    clock = FaultyClock()
    bus, turn = TimedBus(clock), OnClock(PERIOD_S, clock)
    node = PlantNode(bus, database, turn)
    command = Sender(database["ChargeCommand"])
    bus.coming = [(1000.0 + t, command.frame({"CommandCurrent": 0.0})) for t in (0.25, 0.5)]
    node.exchange(0, READINGS, REQUEST)
    assert turn.watch.latency_s == [0.25]


def test_virtual_time_has_no_timing():
    assert LockStep(PERIOD_S, 0.0).watch is None


def test_a_run_in_real_time_shows_its_timing_everywhere(bms, tmp_path):
    code, printed, _ = bms(
        "sil", "--realtime", "--max-time-s", 0.3, "--bus", "virtual:timing", "--out", tmp_path
    )
    assert code == 1
    timing = json.loads((tmp_path / "summary.json").read_text())["timing"]
    assert timing["periods"] == 8 == json.loads((tmp_path / "summary.json").read_text())["steps"]
    assert 0.0 <= timing["lateness"]["median_ms"] <= timing["lateness"]["p99_ms"]
    assert timing["lateness"]["p99_ms"] <= timing["lateness"]["max_ms"]
    assert 0.0 < timing["answer_latency"]["median_ms"] <= timing["answer_latency"]["max_ms"]
    page = (tmp_path / "report.html").read_text()
    for text in (f"{timing['lateness']['max_ms']:.2f} ms", f"{timing['missed_deadlines']} of 8"):
        assert text in printed
        assert text in page
    assert "<h2>Real time</h2>" in page


def test_a_run_in_virtual_time_shows_none(bms, tmp_path):
    code, printed, _ = bms("sil", "--max-time-s", 1, "--bus", "virtual:none", "--out", tmp_path)
    assert code == 1
    assert json.loads((tmp_path / "summary.json").read_text())["timing"] is None
    assert "Deadlines missed" not in printed
    assert "Real time" not in (tmp_path / "report.html").read_text()
