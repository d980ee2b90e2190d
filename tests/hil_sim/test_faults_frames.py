"""What each fault of the network does to the frames that pass, told by hand or by cantools."""

from __future__ import annotations

from importlib.resources import files

import cantools
import numpy as np
import pytest
from cantools import autosar
from hypothesis import given
from hypothesis import strategies as st

from hil_sim.bus.buses import Frame
from hil_sim.bus.database import load_codecs
from hil_sim.bus.e2e import Sender
from hil_sim.faults import Injection, parse_fault
from hil_sim.faults.frames import MessageName

DATABASE = load_codecs()
ORACLE = cantools.database.load_string(files("codegen").joinpath("can/bms.dbc").read_text(), "dbc")
SYNC = Frame(0x080, b"")
COMMAND = Frame(DATABASE["ChargeCommand"].frame_id, bytes(4))
FROM, UNTIL, PERIODS = 3, 6, 10


class StillPlant:
    cooling_power_W = 0.25


class Line:
    """Plays periods with one Coolant and one CellThermal message each, and SYNC."""

    def __init__(self, seed=0, **fault):
        fault = {"from_period": FROM, "for_periods": UNTIL - FROM, **fault}
        self.injection = Injection(
            (parse_fault(fault, "test"),), 0.1, np.random.SeedSequence(seed), DATABASE
        )
        self._senders = [Sender(DATABASE["CellThermal"]), Sender(DATABASE["Coolant"])]
        self.sent, self.arrived, self.heard = [], [], []

    def play(self, periods=PERIODS):
        for period in range(periods):
            self.injection.begin(period, StillPlant())
            values = {"CoolingPower": 0.1 * period, "SurfaceTemperature": 300.0 + period}
            frames = [*(sender.frame(values) for sender in self._senders), SYNC]
            self.sent.append(frames)
            self.arrived.append(self.injection.sent(list(frames)))
            self.heard.append(self.injection.heard([COMMAND]))
        return self

    def coolant(self, frames):
        return [frame for frame in frames if frame.frame_id == DATABASE["Coolant"].frame_id]


def played(**fault):
    return Line(message="Coolant", **fault).play()


KINDS_OF_COOLANT = [
    {"kind": "message-lost"},
    {"kind": "message-delayed", "delay_periods": 2},
    {"kind": "message-repeated"},
    {"kind": "message-frozen"},
    {"kind": "message-reordered"},
    {"kind": "byte-corrupted", "byte": 2},
    {"kind": "message-wrong-id", "frame_id": 0x7FF},
    {"kind": "message-wrong-length", "length": 3},
    {"kind": "message-masqueraded"},
    {"kind": "message-contested", "signal": "CoolingPower", "value": 3.0},
]


@pytest.mark.parametrize("fault", KINDS_OF_COOLANT, ids=lambda fault: fault["kind"])
def test_other_messages_and_other_periods_are_left_alone(fault):
    line = played(**fault)
    for period, (sent, arrived) in enumerate(zip(line.sent, line.arrived)):
        others = [frame for frame in arrived if frame in (sent[0], SYNC)]
        assert others == [sent[0], SYNC]
        if period < FROM or period > UNTIL:
            assert arrived == sent
        elif period < UNTIL:
            assert arrived != sent


@pytest.mark.parametrize("fault", KINDS_OF_COOLANT, ids=lambda fault: fault["kind"])
def test_a_fault_without_an_end_stays(fault):
    line = Line(message="Coolant", for_periods=None, **fault).play(15)
    assert all(arrived != sent for sent, arrived in list(zip(line.sent, line.arrived))[FROM:])


def coolant_of(line, period):
    """Coolant frames that arrive in a period, each as the number of the period it was sent in."""
    sent = [frames[1] for frames in line.sent]
    return [sent.index(frame) for frame in line.coolant(line.arrived[period])]


@pytest.mark.parametrize(
    ("fault", "arrivals"),
    [
        ({"kind": "message-lost"}, {3: [], 4: [], 5: [], 6: [6]}),
        (
            {"kind": "message-delayed", "delay_periods": 1},
            {3: [], 4: [3], 5: [4], 6: [5, 6], 7: [7]},
        ),
        (
            {"kind": "message-delayed", "delay_periods": 2},
            {3: [], 4: [], 5: [3], 6: [4, 5, 6], 7: [7]},
        ),
        ({"kind": "message-repeated", "copies": 2}, {3: [3, 3, 3], 5: [5, 5, 5], 6: [6]}),
        ({"kind": "message-frozen"}, {3: [2], 4: [2], 5: [2], 6: [6]}),
        ({"kind": "message-reordered"}, {3: [], 4: [4, 3], 5: [], 6: [6, 5], 7: [7]}),
    ],
    ids=lambda value: value.get("kind") if "kind" in value else None,
)
def test_frames_arrive_when_they_should(fault, arrivals):
    line = played(**fault)
    for period, numbers in arrivals.items():
        assert coolant_of(line, period) == numbers, f"period {period}"


@given(byte=st.integers(0, 3), mask=st.integers(1, 255))
def test_a_corrupted_byte_has_exactly_the_bits_of_the_mask_inverted(byte, mask):
    line = played(kind="byte-corrupted", byte=byte, mask=mask)
    (sent, arrived) = line.sent[FROM][1].data, line.arrived[FROM][1].data
    changed = bytes(a ^ b for a, b in zip(sent, arrived))
    assert changed == bytes(byte) + bytes([mask]) + bytes(3 - byte)


def test_a_wrong_id_leaves_the_content():
    line = played(kind="message-wrong-id", frame_id=0x101)
    assert line.arrived[FROM][1] == Frame(0x101, line.sent[FROM][1].data)


@pytest.mark.parametrize("length", [0, 3, 5, 8])
def test_a_wrong_length_cuts_off_or_adds_zeros(length):
    line = played(kind="message-wrong-length", length=length)
    sent, arrived = line.sent[FROM][1].data, line.arrived[FROM][1].data
    assert arrived == (sent + bytes(8))[:length]


def test_a_masquerader_sends_new_content_under_a_valid_crc_with_the_last_counter():
    line = played(kind="message-masqueraded")
    message = ORACLE.get_message_by_name("Coolant")
    ids = bytes.fromhex(message.dbc.attributes["E2EProfile2DataIdList"].value)
    for period in range(FROM, UNTIL):
        data = line.arrived[period][1].data
        values = message.decode(data, decode_choices=False)
        assert values["CoolantCounter"] == FROM - 1
        assert values["CoolingPower"] == pytest.approx(0.1 * period)
        assert autosar.compute_profile2_crc(data, ids[FROM - 1]) == data[0]


@pytest.mark.parametrize(("position", "steps"), [("ahead", 0), ("behind", 1)])
def test_who_contests_a_message_sends_it_beside_the_true_one(position, steps):
    line = played(kind="message-contested", signal="CoolingPower", value=3.0, position=position)
    message = ORACLE.get_message_by_name("Coolant")
    ids = bytes.fromhex(message.dbc.attributes["E2EProfile2DataIdList"].value)
    for period in range(FROM, UNTIL):
        both = [f for f in line.arrived[period] if f.frame_id == message.frame_id]
        true = next(f for f in line.sent[period] if f.frame_id == message.frame_id)
        other = both[1] if position == "behind" else both[0]
        assert both == ([true, other] if position == "behind" else [other, true])
        values = message.decode(other.data, decode_choices=False)
        counter = (period + steps) % 16
        assert values["CoolantCounter"] == counter
        assert values["CoolingPower"] == pytest.approx(3.0)
        assert autosar.compute_profile2_crc(other.data, ids[counter]) == other.data[0]


def test_a_bus_that_is_off_carries_sync_alone_in_both_directions():
    line = Line(kind="bus-off").play()
    for period in range(FROM, UNTIL):
        assert (line.arrived[period], line.heard[period]) == ([SYNC], [])
    assert (line.arrived[UNTIL], line.heard[UNTIL]) == (line.sent[UNTIL], [COMMAND])


def test_a_fault_of_an_ecu_message_acts_on_what_the_plant_hears():
    injection = Injection(
        (parse_fault({"kind": "message-lost", "message": "ChargeCommand", "from_s": 0.0}, "t"),),
        0.1,
        np.random.SeedSequence(0),
        DATABASE,
    )
    injection.begin(0, StillPlant())
    assert injection.heard([SYNC, COMMAND]) == [SYNC]


@pytest.mark.parametrize("position", ["before", "between", "after"])
def test_a_flood_adds_foreign_frames_and_keeps_the_order_of_the_others(position):
    line = Line(kind="bus-flood", frames_per_period=40, position=position).play()
    known = {codec.frame_id for codec in DATABASE.values()}
    for period in range(FROM, UNTIL):
        arrived = line.arrived[period]
        foreign = [frame for frame in arrived if frame.frame_id not in known]
        assert len(foreign) == 40
        assert [frame for frame in arrived if frame.frame_id in known] == line.sent[period]
        assert all(0 <= frame.frame_id <= 0x7FF and len(frame.data) <= 8 for frame in foreign)
        ends = {"before": (False, True), "between": (True, True), "after": (True, False)}
        assert (arrived[0] not in foreign, arrived[-1] not in foreign) == ends[position]
    assert line.heard == [[COMMAND]] * PERIODS


def test_a_flood_is_the_same_for_the_same_seed_only():
    floods = [Line(seed, kind="bus-flood").play().arrived for seed in (1, 1, 2)]
    assert floods[0] == floods[1] != floods[2]


def test_every_message_but_sync_can_be_hit():
    # The plant sends no ChargeMode, and the boot stage is not in these runs.
    assert set(MessageName.__args__) == set(DATABASE) - {"SYNC", "ChargeMode", "BootRefusal"}


def test_what_was_injected_is_on_record():
    line = played(kind="message-lost")
    (injected,) = line.injection.injected
    assert (injected.kind, injected.where) == ("message-lost", "Coolant")
    assert (injected.begin_s, injected.end_s) == (pytest.approx(0.3), pytest.approx(0.6))
    assert Line(kind="bus-off").play(FROM).injection.injected == ()
    assert Line(kind="bus-off").play(UNTIL).injection.injected[0].end_s is None
