"""A pack's frames at the ends of what they hold: lengths, codes, groups, pages and places."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tests.firmware.native_library import FIRMWARE, load_library

HEADERS = (
    *("include/can_frame.h", "include/e2e.h", "include/codec.h"),
    *("pack/generated/pack_catalog.h", "pack_ecu/pack_codec.h"),
)
SOURCES = ("pack/generated/pack_catalog.c", "pack_ecu/pack_codec.c", "src/codec.c", "src/e2e.c")
TABLES = """
extern const codec_message_t PACK_RECEIVED[PACK_RECEIVED_COUNT];
extern const pack_group_t PACK_GROUPS[PACK_GROUP_COUNT];
extern const pack_signal_t PACK_SIGNALS[PACK_SIGNAL_COUNT];
"""
LONGEST_OUTBOX, PAGE_CELLS, PAGES, MESSAGES = 16, 3, 16, 4


@pytest.fixture(scope="module")
def codec(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Declarations and library of the codec."""
    sources = [FIRMWARE / name for name in SOURCES]
    sources += [FIRMWARE / "generated" / name for name in ("can_catalog.c", "can_db.c")]
    includes = [f"-I{FIRMWARE / folder}" for folder in ("pack", "pack/generated", "pack_ecu")]
    out = tmp_path_factory.mktemp("pack_codec")
    return load_library(out, sources, HEADERS, extra=TABLES, flags=includes)


def frame_of(codec: Any, length: int, frame_id: int = 0) -> Any:
    """Byte n of it is n + 1."""
    ffi, _ = codec
    return ffi.new("can_frame_t *", {"id": frame_id, "length": length, "data": list(range(1, 9))})


@pytest.mark.parametrize("length", range(10))
def test_of_a_frame_no_byte_beyond_its_length_is_read_and_none_beyond_eight(
    codec: Any, length: int
) -> None:
    expected = int.from_bytes(bytes(range(1, min(length, 8) + 1)), "little")
    assert codec[1].pack_bits(frame_of(codec, length)) == expected


def test_what_is_filled_in_is_what_is_read(codec: Any) -> None:
    ffi, lib = codec
    frame = ffi.new("can_frame_t *")
    for index in range(lib.PACK_RECEIVED_COUNT):
        message = ffi.addressof(lib.PACK_RECEIVED[index])
        kept = (1 << 8 * message.length) - 1
        lib.pack_fill(frame, message, 0x8877665544332211)
        assert (frame.id, frame.length) == (message.id, message.length)
        assert lib.pack_bits(frame) == 0x8877665544332211 & kept


def test_a_code_that_its_field_cannot_hold_says_not_available(codec: Any) -> None:
    """All ones; every field of a code has as many values as bits."""
    _, lib = codec
    for signal in (lib.PACK_SIGNAL_PACK_STATE, lib.PACK_SIGNAL_CELLS, lib.PACK_SIGNAL_REQUEST):
        place = lib.PACK_SIGNALS[signal]
        ones = (1 << place.length) - 1
        for code in (0, ones - 1, ones, ones + 1, 2**32 - 1):
            assert lib.pack_with_code(signal, code) == min(code, ones) << place.start
            assert lib.pack_code(lib.pack_with_code(signal, code), signal) == min(code, ones)


def test_a_hash_of_32_bits_is_carried_whole(codec: Any) -> None:
    _, lib = codec
    for code in (0, 1, 0x80000000, 0xFFFFFFFF):
        bits = lib.pack_with_code(lib.PACK_SIGNAL_MODEL_HASH, code)
        assert lib.pack_code(bits, lib.PACK_SIGNAL_MODEL_HASH) == code


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_no_number_says_not_available(codec: Any, value: float) -> None:
    _, lib = codec
    bits = lib.pack_with_value(lib.PACK_SIGNAL_PACK_CURRENT, value, lib.CODEC_NEAREST)
    assert lib.pack_code(bits, lib.PACK_SIGNAL_PACK_CURRENT) == 0xFFFFF
    assert math.isnan(lib.pack_value(bits, lib.PACK_SIGNAL_PACK_CURRENT))


def test_a_command_is_rounded_towards_none(codec: Any) -> None:
    """In steps of 2 mA: what lies between two of them is the weaker one."""
    _, lib = codec
    for current_A, sent_A in ((-9.9999, -9.998), (-10.0, -10.0), (-10.0019, -10.0)):
        bits = lib.pack_with_value(
            lib.PACK_SIGNAL_COMMAND_CURRENT, current_A, lib.CODEC_TOWARDS_ZERO
        )
        assert lib.pack_value(bits, lib.PACK_SIGNAL_COMMAND_CURRENT) == pytest.approx(
            sent_A, abs=1e-5
        )


def test_a_group_has_its_own_identifiers_and_no_others(codec: Any) -> None:
    ffi, lib = codec
    page = ffi.new("uint32_t *")
    for group in range(lib.PACK_GROUP_COUNT):
        first = lib.PACK_GROUPS[group].message[0].id
        for offset, is_page in ((-1, False), (0, True), (MESSAGES - 1, True), (MESSAGES, False)):
            frame = frame_of(codec, 8, first + offset)
            frame.data[1] = 0xB7  # page 11 of the message, counter 7
            assert lib.pack_page_of(group, frame, page) is is_page
            if is_page:
                assert page[0] == PAGES * offset + 11
                assert lib.pack_page_message(group, page[0]).id == first + offset


@pytest.mark.parametrize(
    ("cells", "pages"), [(0, 0), (1, 1), (3, 1), (4, 2), (6, 2), (191, 64), (192, 64)]
)
def test_a_page_has_three_cells_and_the_last_one_what_is_left(
    codec: Any, cells: int, pages: int
) -> None:
    _, lib = codec
    assert lib.pack_pages(cells) == pages
    left = [lib.pack_cells_from(cells, page) for page in range(pages)]
    assert sum(left) == cells
    assert left[:-1] == [PAGE_CELLS] * max(pages - 1, 0)
    assert lib.pack_cells_from(cells, pages) == 0
    assert lib.pack_cells_from(cells, pages + 1) == 0


@pytest.mark.parametrize("count", range(4))
def test_places_of_a_page_beyond_its_cells_are_not_available(codec: Any, count: int) -> None:
    ffi, lib = codec
    group, page = lib.PACK_GROUP_CELL_VOLTAGES, PAGES + 5
    frame = ffi.new("can_frame_t *")
    lib.pack_fill_page(frame, group, page, ffi.new("float[]", [3.1, 3.2, 3.3]), count)
    assert frame.id == lib.PACK_GROUPS[group].message[1].id
    assert frame.data[1] == 5 << 4
    read = [lib.pack_page_value(group, frame, place) for place in range(PAGE_CELLS)]
    assert read[:count] == pytest.approx([3.1, 3.2, 3.3][:count], abs=5.1e-5)
    assert all(math.isnan(value) for value in read[count:])


def test_all_that_an_ecu_says_in_a_period_fits_into_its_outbox(codec: Any) -> None:
    """Every message at once, as in the first period, and the pages of each group that is sent."""
    _, lib = codec
    sent = (lib.PACK_GROUP_CELL_CORES, lib.PACK_GROUP_CELL_CHARGES, lib.PACK_GROUP_CELL_BLEEDS)
    pages = [lib.PACK_GROUPS[group].pages_a_period for group in sent]
    assert min(pages) >= 1
    assert sum(pages) + lib.PACK_TRANSMITTED_COUNT <= LONGEST_OUTBOX
    header = (FIRMWARE / "pack_ecu" / "pack_ecu.h").read_text(encoding="utf-8")
    assert f"#define PACK_ECU_OUTBOX {LONGEST_OUTBOX} " in header
