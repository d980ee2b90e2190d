"""End-to-end protection in C against cantools' independent AUTOSAR implementation."""

from __future__ import annotations

import itertools
from typing import Any

import cantools.autosar
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from codegen.can_database import data_ids
from tests.firmware.bench import DATABASE, HEALTHY, RECEIVED, frame

PROTECTED = [m for m in DATABASE.messages if data_ids(m)]
MAX_DELTA = 3
FASTEST = 0
IDS = st.binary(min_size=16, max_size=16)
PAYLOAD = st.binary(min_size=2, max_size=8)


@given(data=PAYLOAD, ids=IDS)
def test_crc_is_that_of_profile_2(data: bytes, ids: bytes) -> None:
    expected = cantools.autosar.compute_profile2_crc(data, ids[data[1] & 0x0F])
    assert lib.e2e_crc(data, len(data), ids) == expected


@pytest.mark.parametrize("at", [1, 2])
def test_the_crc_takes_every_byte(at: int) -> None:
    for value in range(256):
        data = bytes([0, 0, 0x5A])
        data = data[:at] + bytes([value]) + data[at + 1 :]
        expected = cantools.autosar.compute_profile2_crc(data, 0xC3)
        assert lib.e2e_crc(data, len(data), bytes([0xC3] * 16)) == expected, value


@given(data=PAYLOAD, ids=IDS, counter=st.integers(0, 255))
def test_protected_frame_passes_the_check_of_others_and_keeps_its_content(
    data: bytes, ids: bytes, counter: int
) -> None:
    buffer = ffi.new("uint8_t[8]", data)
    lib.e2e_protect(buffer, len(data), ids, counter)
    protected = bytes(ffi.buffer(buffer, len(data)))
    assert protected[1] & 0x0F == counter % 16
    assert protected[1] & 0xF0 == data[1] & 0xF0
    assert protected[2:] == data[2:]
    assert cantools.autosar.check_profile2_crc(protected, ids[counter % 16])


def protect(counter: int, ids: bytes, length: int = 6) -> bytes:
    return bytes(
        cantools.autosar.apply_profile2_crc(
            bytes([0, counter % 16] + [7] * (length - 2)), ids[counter % 16]
        )
    )


def check(receiver: Any, data: bytes, ids: bytes = bytes(16)) -> int:
    return int(lib.e2e_check(receiver, data, len(data), 6, ids, MAX_DELTA))


def counts(receiver: Any) -> dict[str, int]:
    names = ("wrong_length", "wrong_crc", "repeated", "lost", "reordered")
    return {name: getattr(receiver.counts, name) for name in names}


@pytest.mark.parametrize("message", PROTECTED, ids=lambda m: m.name)
@pytest.mark.parametrize("counter", range(16))
def test_every_protected_message_has_its_own_data_id_for_every_counter(
    message: Any, counter: int
) -> None:
    others = [data_ids(m)[counter] for m in PROTECTED if m is not message]
    assert data_ids(message)[counter] not in others


def test_the_ecu_protects_every_message_with_the_data_id_of_its_counter() -> None:
    ecu = Ecu("lin2014")
    seen = set()
    for period in range(16 * 10):
        ecu.receive(*frame("ChargeMode", period, {"Mode": FASTEST}))  # asks for Plan too
        ecu.step()
        for frame_id, data in ecu.transmit():
            message = DATABASE.get_message_by_frame_id(frame_id)
            if data_ids(message):
                counter = data[1] & 0x0F
                assert cantools.autosar.check_profile2_crc(data, data_ids(message)[counter])
                seen.add((message.name, counter))
    sent = [m.name for m in PROTECTED if m.senders == ["ECU"] and m.name != "BootRefusal"]
    assert seen == set(itertools.product(sent, range(16)))


@pytest.mark.parametrize("counter", range(16))
@pytest.mark.parametrize("name", RECEIVED)
def test_the_ecu_takes_every_message_with_the_data_id_of_its_counter_only(
    name: str, counter: int
) -> None:
    frame_id, data = frame(name, counter, HEALTHY)
    own = data_ids(DATABASE.get_message_by_name(name))
    for data_id in {*own, 0x00, 0xFF}:
        network, measurement = ffi.new("network_t *"), ffi.new("codec_measurement_t *")
        payload = bytes(cantools.autosar.apply_profile2_crc(data, data_id))
        lib.network_receive(
            network, ffi.new("can_frame_t *", [frame_id, len(data), payload]), measurement
        )
        receiver = network.receivers[RECEIVED.index(name)]
        assert receiver.is_good == (data_id == own[counter])
        assert receiver.counts.wrong_crc == (data_id != own[counter])


@given(ids=IDS, start=st.integers(0, 15), delta=st.integers(0, 15))
def test_the_counter_tells_new_repeated_lost_and_reordered_apart(
    ids: bytes, start: int, delta: int
) -> None:
    receiver = ffi.new("e2e_receiver_t *")
    assert check(receiver, protect(start, ids), ids) == lib.E2E_OK
    answer = check(receiver, protect(start + delta, ids), ids)
    expected = dict.fromkeys(counts(receiver), 0)
    if delta == 0:
        assert answer == lib.E2E_REPEATED
        expected["repeated"] = 1
    elif delta <= MAX_DELTA:
        assert answer == lib.E2E_OK
        expected["lost"] = delta - 1
    elif delta >= 16 - MAX_DELTA:
        assert answer == lib.E2E_REORDERED
        expected["reordered"] = 1
    else:
        assert answer == lib.E2E_WRONG_SEQUENCE
        expected["lost"] = delta - 1
    assert counts(receiver) == expected


@given(start=st.integers(0, 15), delta=st.integers(MAX_DELTA + 1, 14))
def test_a_sender_that_starts_anew_is_followed_from_its_second_frame_on(
    start: int, delta: int
) -> None:
    receiver = ffi.new("e2e_receiver_t *")
    sent = [check(receiver, protect(n, bytes(16))) for n in (start, start + delta, start + delta)]
    assert lib.E2E_OK not in sent[1:]
    assert check(receiver, protect(start + delta + 1, bytes(16))) == lib.E2E_OK
    assert check(receiver, protect(start + delta + 2, bytes(16))) == lib.E2E_OK


def test_a_frame_that_comes_late_is_refused_and_does_not_break_the_sequence() -> None:
    receiver = ffi.new("e2e_receiver_t *")
    statuses = [check(receiver, protect(n, bytes(16))) for n in (4, 6, 5, 7, 8)]
    ok, late = lib.E2E_OK, lib.E2E_REORDERED
    assert statuses == [ok, ok, late, ok, ok]


MISHAPS = ("none", "lost", "lost twice", "repeated", "swapped", "wrong crc", "wrong length")


@given(mishaps=st.lists(st.sampled_from(MISHAPS), max_size=60), ids=IDS)
def test_mishaps_of_a_channel_are_counted_by_kind(mishaps: list[str], ids: bytes) -> None:
    """Between two mishaps one frame passes undisturbed."""
    receiver = ffi.new("e2e_receiver_t *")
    number = 0
    check(receiver, protect(number, ids), ids)
    for mishap in mishaps:
        following = [protect(number + n, ids) for n in range(1, 3)]
        number += 2 if mishap in ("lost twice", "swapped") else 1
        if mishap in ("none", "repeated"):
            check(receiver, following[0], ids)
        if mishap == "repeated":
            check(receiver, following[0], ids)
        if mishap == "swapped":
            check(receiver, following[1], ids)
            check(receiver, following[0], ids)
        if mishap == "wrong crc":
            check(receiver, bytes([following[0][0] ^ 0x5A]) + following[0][1:], ids)
        if mishap == "wrong length":
            check(receiver, following[0][:-1], ids)
        number += 1
        assert check(receiver, protect(number, ids), ids) == lib.E2E_OK
    swapped = mishaps.count("swapped")
    unread = mishaps.count("wrong crc") + mishaps.count("wrong length")
    assert counts(receiver) == {
        "wrong_length": mishaps.count("wrong length"),
        "wrong_crc": mishaps.count("wrong crc"),
        "repeated": mishaps.count("repeated"),
        "lost": mishaps.count("lost") + 2 * mishaps.count("lost twice") + swapped + unread,
        "reordered": swapped,
    }


def test_counts_stay_at_their_maximum() -> None:
    receiver = ffi.new("e2e_receiver_t *")
    for first in range(0, 1200, 4):
        check(receiver, b"\0")
        for counter in (first, first + 3, first + 3, first + 2):
            check(receiver, protect(counter, bytes(16)))
        check(receiver, bytes([protect(3, bytes(16))[0] ^ 1]) + protect(3, bytes(16))[1:])
    assert counts(receiver) == dict.fromkeys(counts(receiver), 255)


@given(ids=IDS, bit=st.integers(0, 47))
def test_every_single_bit_error_is_noticed_and_the_good_frame_still_counts(
    ids: bytes, bit: int
) -> None:
    receiver = ffi.new("e2e_receiver_t *")
    good = protect(5, ids)
    bad = bytearray(good)
    bad[bit // 8] ^= 1 << bit % 8
    status = check(receiver, bytes(bad), ids)
    same_counter_id = bytes(bad)[1] & 0x0F == 5 or ids[bytes(bad)[1] & 0x0F] == ids[5]
    if same_counter_id:
        assert status == lib.E2E_WRONG_CRC
        assert check(receiver, good, ids) == lib.E2E_OK
