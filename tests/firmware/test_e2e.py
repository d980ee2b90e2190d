"""End-to-end protection in C against cantools' independent AUTOSAR implementation."""

from __future__ import annotations

import cantools.autosar
from bms.firmware._firmware import ffi, lib
from hypothesis import given
from hypothesis import strategies as st

IDS = st.binary(min_size=16, max_size=16)
PAYLOAD = st.binary(min_size=2, max_size=8)


@given(data=PAYLOAD, ids=IDS)
def test_crc_is_that_of_profile_2(data: bytes, ids: bytes) -> None:
    expected = cantools.autosar.compute_profile2_crc(data, ids[data[1] & 0x0F])
    assert lib.e2e_crc(data, len(data), ids) == expected


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


def check(receiver: object, data: bytes, ids: bytes) -> int:
    return int(lib.e2e_check(receiver, data, len(data), 6, ids, 3))


@given(ids=IDS, start=st.integers(0, 15), jump=st.integers(0, 15))
def test_counter_decides_between_fresh_repeated_and_broken(
    ids: bytes, start: int, jump: int
) -> None:
    receiver = ffi.new("e2e_receiver_t *")
    assert check(receiver, protect(start, ids), ids) == lib.E2E_OK
    answer = check(receiver, protect(start + jump, ids), ids)
    if jump == 0:
        assert answer == lib.E2E_REPEATED
    elif jump <= 3:
        assert answer == lib.E2E_OK
    else:
        assert answer == lib.E2E_WRONG_SEQUENCE
        assert check(receiver, protect(start + jump + 1, ids), ids) == lib.E2E_OK


@given(ids=IDS, bit=st.integers(0, 47))
def test_every_single_bit_error_is_noticed_and_leaves_the_receiver_alone(
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
