"""What a charger has of the firmware's supervision, against cantools and the database."""

from __future__ import annotations

import cantools.autosar
import pytest

from bms.firmware import Reception, ReceptionCounts
from bms.firmware._firmware import ffi, lib
from codegen.can_database import data_ids, load_database, number_attribute

DATABASE = load_database()
COMMAND = DATABASE.get_message_by_name("ChargeCommand")
FROM_ECU = [m for m in DATABASE.messages if m.senders == ["ECU"] and m.name != "BootRefusal"]
POLICY = {
    "E2EMaxDeltaCounter": lambda policy: policy.max_delta_counter,
    "E2EWindowSize": lambda policy: policy.window_periods,
    "E2EMinOkStateInit": lambda policy: policy.init.min_good,
    "E2EMaxErrorStateInit": lambda policy: policy.init.max_bad,
    "E2EMinOkStateValid": lambda policy: policy.valid.min_good,
    "E2EMaxErrorStateValid": lambda policy: policy.valid.max_bad,
    "E2EMinOkStateInvalid": lambda policy: policy.invalid.min_good,
    "E2EMaxErrorStateInvalid": lambda policy: policy.invalid.max_bad,
}


def frame(counter: int, length: int = COMMAND.length) -> bytes:
    plain = bytes([0, counter % 16] + [7] * (length - 2))
    return bytes(cantools.autosar.apply_profile2_crc(plain, data_ids(COMMAND)[counter % 16]))


def started(periods: int = 3) -> Reception:
    reception = Reception(COMMAND.frame_id)
    for counter in range(periods):
        assert reception.check(frame(counter))
        reception.end_period()
    return reception


def test_a_command_counts_from_the_third_period_on():
    reception = Reception(COMMAND.frame_id)
    usable = []
    for counter in range(5):
        assert reception.check(frame(counter))
        usable.append(reception.end_period())
    assert usable == [False, False, True, True, True]


@pytest.mark.parametrize(
    ("data", "counted"),
    [
        (frame(3)[:-1], ReceptionCounts(1, 0, 0, 0, 0)),
        (frame(3) + b"\0", ReceptionCounts(1, 0, 0, 0, 0)),
        (b"", ReceptionCounts(1, 0, 0, 0, 0)),
        (bytes(400), ReceptionCounts(1, 0, 0, 0, 0)),
        (bytes([frame(3)[0] ^ 1]) + frame(3)[1:], ReceptionCounts(0, 1, 0, 0, 0)),
        (frame(2), ReceptionCounts(0, 0, 1, 0, 0)),
        (frame(1), ReceptionCounts(0, 0, 0, 0, 1)),
        (frame(10), ReceptionCounts(0, 0, 0, 7, 0)),
    ],
    ids=["short", "long", "empty", "oversized", "crc", "repeated", "reordered", "out of sequence"],
)
def test_a_refused_command_is_counted_by_its_kind(data, counted):
    reception = started()
    assert not reception.check(data)
    assert reception.counts == counted
    assert not reception.end_period()


def test_lost_commands_are_counted_and_the_next_is_taken():
    reception = started()
    assert reception.check(frame(5))
    assert reception.counts == ReceptionCounts(0, 0, 0, 2, 0)
    assert reception.end_period()


@pytest.mark.parametrize("message", FROM_ECU, ids=lambda m: m.name)
def test_policies_are_those_of_the_database(message):
    table = [lib.host_transmitted_messages()[i] for i in range(lib.host_transmitted_count())]
    (row,) = [row for row in table if row.id == message.frame_id]
    if not data_ids(message):
        with pytest.raises(ValueError, match=f"0x{message.frame_id:03X}"):
            Reception(message.frame_id)
        return
    Reception(message.frame_id)
    assert bytes(ffi.buffer(row.data_ids)) == data_ids(message)
    for attribute, value in POLICY.items():
        assert value(row.policy) == number_attribute(DATABASE, message, attribute)


def test_a_message_of_the_plant_is_none_of_the_ecu():
    with pytest.raises(ValueError, match="0x100"):
        Reception(0x100)
