"""What the monitor knows follows from the frames and their times alone."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.presets import load_preset
from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import NETWORK_VERSION
from hil_sim.bus.e2e import Sender
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.bus.identity import Identity
from hil_sim.monitor.model import Reading, SystemModel
from hil_sim.monitor.presets import PresetFinder
from hil_sim.monitor.traffic import Rate


class Feed:
    """A model and senders for its messages."""

    def __init__(self, database):
        self.model = SystemModel(database)
        self._senders = {name: Sender(codec) for name, codec in database.items()}

    def send(self, time_s, name, **values):
        self.model.take(time_s, self._senders[name].frame(values))


@pytest.fixture
def feed(database):
    return Feed(database)


def test_before_the_first_frame_nothing_is_available_and_nothing_is_stale(feed):
    snapshot = feed.model.snapshot(5.0)
    assert set(snapshot.readings.values()) == {Reading(None, False)}
    assert {(m.age_s, m.is_stale, m.rate_per_s) for m in snapshot.messages} == {(None, False, 0.0)}
    assert {(r.state, r.counts, r.is_stale) for r in snapshot.receivers} == {(None, (), False)}
    assert (snapshot.silence_s, snapshot.is_silent, snapshot.identity) == (None, False, None)
    assert snapshot.faults("LatchedFaults") is None
    assert snapshot.name("DiagnosticState") is None


def test_values_are_those_of_the_last_good_frame(feed, database):
    feed.send(1.0, "CellThermal", SurfaceTemperature=300.0, CoolantTemperature=290.0)
    feed.send(1.1, "CellThermal", SurfaceTemperature=301.0)
    feed.model.take(1.2, Frame(database["CellThermal"].frame_id, bytes(6)))
    feed.model.take(1.3, Frame(database["CellThermal"].frame_id, bytes(5)))
    snapshot = feed.model.snapshot(1.3)
    assert snapshot.readings["SurfaceTemperature"].value == pytest.approx(301.0)
    assert snapshot.readings["CoolantTemperature"].value is None
    thermal = snapshot.message("CellThermal")
    assert thermal.refused == 2
    assert thermal.age_s == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("name", "signal", "cycle_s"), [("Decision", "LowerCurrent", 0.1), ("Identity", "ModelHash", 1)]
)
def test_a_message_is_stale_after_three_of_its_cycles(feed, name, signal, cycle_s):
    feed.send(10.0, name, **{signal: 1.0})
    for age_s, is_stale in ((2.99 * cycle_s, False), (3.01 * cycle_s, True)):
        snapshot = feed.model.snapshot(10.0 + age_s)
        assert snapshot.message(name).is_stale is is_stale
        assert snapshot.readings[signal].is_stale is is_stale
        assert snapshot.readings[signal].value == pytest.approx(1.0, abs=1e-3)


def test_a_message_that_comes_again_is_fresh_again(feed):
    feed.send(0.0, "Coolant", CoolingPower=1.0)
    assert feed.model.snapshot(9.0).readings["CoolingPower"].is_stale
    feed.send(9.0, "Coolant", CoolingPower=2.0)
    assert feed.model.snapshot(9.0).readings["CoolingPower"] == Reading(pytest.approx(2.0), False)


def test_the_bus_is_silent_when_nothing_of_the_system_comes_whatever_else_does(feed):
    feed.send(0.0, "Identity", PresetHash=1, ModelHash=1, FirmwareVersion=1)
    feed.send(1.0, "Coolant", CoolingPower=1.0)
    feed.model.take(5.0, Frame(0x300, b""))
    assert not feed.model.snapshot(1.2).is_silent
    snapshot = feed.model.snapshot(5.0)
    assert (snapshot.silence_s, snapshot.is_silent) == (4.0, True)


def test_lock_step_is_told_by_the_sync_frames(feed):
    feed.send(0.0, "ChargeCommand", CommandCurrent=-1.0)
    assert not feed.model.snapshot(0.0).is_lock_step
    feed.send(0.1, "SYNC")
    assert feed.model.snapshot(0.1).is_lock_step
    assert not feed.model.snapshot(0.5).is_lock_step


def test_faults_have_their_names(feed):
    feed.send(
        0.0, "Diagnostics", DiagnosticState=5, FirstFault=19, ActiveFaults=0b10, LatchedFaults=2**19
    )
    snapshot = feed.model.snapshot(0.0)
    assert snapshot.name("DiagnosticState") == "Fault"
    assert snapshot.name("FirstFault") == "SurfaceDeficit"
    assert snapshot.faults("ActiveFaults") == ["ThermalMissing"]
    assert snapshot.faults("LatchedFaults") == ["SurfaceDeficit"]


def test_each_report_of_the_ecu_stands_until_its_turn_did_not_come_three_times(feed):
    for number, counts in ((0, (1, 2, 3, 4, 255)), (2, (0, 0, 0, 0, 0))):
        names = ("WrongCrc", "WrongLength", "Repeated", "Lost", "Reordered")
        feed.send(
            0.5 * number,
            "NetworkDiagnostics",
            ReportedMessage=number,
            ReportedState=2 if number else 3,
            **{f"{name}Frames": count for name, count in zip(names, counts)},
        )
    electrical, thermal, coolant, *_ = feed.model.snapshot(1.0).receivers
    assert (electrical.name, electrical.frame_id) == ("CellElectrical", 0x100)
    assert (electrical.state, electrical.counts) == ("Invalid", (1, 2, 3, 4, 255))
    assert (coolant.state, coolant.counts) == ("Valid", (0, 0, 0, 0, 0))
    assert thermal.state is None
    is_stale = [report.is_stale for report in feed.model.snapshot(8.0).receivers]
    assert is_stale == [True, False, False, False, False]


def test_foreign_frames_are_counted_by_kind_and_identifier(feed):
    for frame in (Frame(0x300, b"1"), Frame(0x300, b"2"), Frame(0x7FF, b""), ForeignFrame.FD):
        feed.model.take(0.0, frame)
    feed.model.take(0.5, ForeignFrame.REMOTE)
    foreign = feed.model.snapshot(0.5).foreign
    assert (foreign.frames, foreign.identifiers) == (5, 2)
    assert foreign.kinds == ((ForeignFrame.REMOTE, 1), (ForeignFrame.FD, 1))
    assert foreign.rate_per_s == pytest.approx(8.0)
    assert feed.model.frames == 5


@given(st.floats(0.01, 1.0), st.integers(2, 200))
def test_the_rate_of_equal_cycles_is_their_inverse_until_the_window_is_empty(cycle_s, frames):
    rate = Rate()
    for number in range(frames):
        rate.add(number * cycle_s)
    end_s = (frames - 1) * cycle_s
    assert rate.per_s(end_s) == pytest.approx(1.0 / cycle_s)
    assert rate.per_s(end_s + 3.1) == 0.0


@given(st.lists(st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)), max_size=60))
def test_any_frames_leave_a_snapshot(database, frames):
    model = SystemModel(database)
    for number, frame in enumerate(frames):
        model.take(0.01 * number, Frame(*frame))
    snapshot = model.snapshot(1.0)
    unused = sum(message.refused for message in snapshot.messages) + snapshot.foreign.frames
    assert unused <= model.frames == len(frames)


LIN2014, PAPER = load_preset("lin2014"), load_preset("paper_calibrated")


def identity(digits):
    return Identity(NETWORK_VERSION, firmware_version=1, model_hash="12345678", preset_hash=digits)


@pytest.mark.parametrize(
    ("given_preset", "hash_", "preset", "remark"),
    [
        (None, PAPER.hash[:4], PAPER, ""),
        (LIN2014, LIN2014.hash[:4], LIN2014, ""),
        (LIN2014, PAPER.hash[:4], PAPER, "--preset lin2014 .* is not the ECU's"),
        (LIN2014, "0000", None, "--preset lin2014 .* is not the ECU's: limits unknown"),
        (None, "0000", None, ".*give --preset FILE.*"),
    ],
)
def test_limits_come_from_the_preset_that_the_ecu_names(given_preset, hash_, preset, remark):
    in_force = PresetFinder(given_preset, [LIN2014, PAPER]).find(identity(hash_))
    assert in_force.preset is preset
    assert re.fullmatch(remark, in_force.remark)


def test_without_an_identity_there_are_no_limits_whatever_preset_is_given():
    in_force = PresetFinder(PAPER, [PAPER]).find(None)
    assert in_force.preset is None
    assert "no Identity" in in_force.remark
