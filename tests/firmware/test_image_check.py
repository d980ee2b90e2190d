"""What is damaged, truncated, foreign or stale is refused, by boot stage and host alike."""

from __future__ import annotations

import ctypes
import mmap
import os
import random
import struct
from pathlib import Path
from typing import Any

import pytest

from bms.errors import InputError
from bms.firmware._firmware import ffi
from bms.firmware.image_checks import IMAGE_OK, IMAGE_STATUS_NAMES
from bms.image import Header, check_image
from bms.image.check import REASONS, check_calibration
from bms.image.floor import FLOOR_LENGTH
from tests.firmware.damaged_images import (
    APPLICATION,
    BOARD,
    BOOT,
    CALIBRATION,
    FLOOR,
    HEADER_LENGTH,
    BootStage,
    damaged_images,
    flipped,
    parts,
    resealed,
)
from tests.firmware.native_library import FIRMWARE, load_library
from tests.firmware.ports import image, needs_compiler

pytestmark = needs_compiler

SOURCES = [FIRMWARE / "image" / f"{name}.c" for name in ("image", "content", "sha256")]
SOURCES.append(FIRMWARE / "src" / "kan.c")
HEADERS = [
    f"include/{name}.h"
    for name in ("kan", "soc", "rcbf", "family", "planner", "thermal", "calibration")
]
HEADERS += ["image/image.h", "image/content.h"]
SAMPLE = 1500
MODEL_OFFSET = ffi.offsetof("bms_calibration_t", "kan")
TABLES_OFFSET = ffi.offsetof("kan_model_t", "tables")

# (replaced text, replacement): each takes one check away.
MUTANTS = {
    "the boot stage's CRC": ("== *crc32) ? IMAGE_OK : IMAGE_WRONG_CRC", "== *crc32) ? IMAGE_OK : IMAGE_OK"),
    "all of the boot stage": ("image_crc32(place->bytes, covered)", "*crc32"),
    "magic": ("(header->magic != magic)", "(header->magic == 0u)"),
    "shortest length": ("(header->length < shortest)", "(header->length < 16u)"),
    "longest length": ("(header->length > place->length)", "(header->length > place->length + 4u)"),
    "CRC": ("        header->crc32) {\n        return IMAGE_WRONG_CRC;", "        header->crc32) {\n"),
    "CRC up to the end": ("header->length - (uint32_t)CRC_COVERS_FROM)", "64u)"),
    "header layout": ("if (header->header_layout != IMAGE_HEADER_LAYOUT)", "if (false)"),
    "hash": ("has_its_content(header, place->bytes) ? IMAGE_OK :", "true ? IMAGE_OK :"),
    "first half of the hash": ("(hash[0] == header->content_hash) &&", ""),
    "second half of the hash": ("&& (hash[1] == header->content_hash_rest)", ""),
    "floor": ("(application->firmware_version >= floor->version) ? IMAGE_OK :", "true ? IMAGE_OK :"),
    "floor's inverse": ("if (floor->inverted_version != ~floor->version)", "if (false)"),
    "erased floor": ("&& (floor->inverted_version == ERASED)", ""),
    "target": ("if (header->target != target)", "if (target == 0u)"),
    "stack": ("(is_stack_right && is_start_right)", "is_start_right"),
    "stack alignment": ("(stack_top % STACK_ALIGNMENT == 0u) &&", ""),
    "within RAM": ("return address - start < length;", "return address < start + length;"),
    "start": ("(is_stack_right && is_start_right)", "is_stack_right"),
    "Thumb code": ("((start & THUMB_BIT) != 0u) &&", ""),
    "start in the part": ("header->length - IMAGE_VECTORS_OFFSET);", "place->length);"),
    "calibration layout": ("(header->calibration_layout != application->calibration_layout) ||", ""),
    "calibration length": ("||\n        (header->calibration_length != application->calibration_length)", ""),
    "end of the tables": ("(header->length == sizeof *header + content_calibration_length(calibration)) &&", ""),
    "fixed part of the model": ("(header->length < UP_TO_TABLES)", "(header->length < 16u)"),
    "firmware version": ("if (header->firmware_version != application->firmware_version)", "if (false)"),
    "model": ("(calibration->model_hash == header->model_hash) &&", ""),
    "preset": ("&&\n        (calibration->preset_hash == header->preset_hash)", ""),
    "block layout": ("has_layout && !is_short &&", "!is_short &&"),
}  # fmt: skip


@pytest.fixture(scope="module")
def boot_stage(tmp_path_factory: pytest.TempPathFactory) -> BootStage:
    return BootStage(*load_library(tmp_path_factory.mktemp("image"), SOURCES, HEADERS))


def host_takes(content: bytes) -> bool:
    try:
        check_image(content, BOARD, "image")
    except InputError as error:
        assert "\n" not in str(error) and "; " in str(error), "one line with a remedy"
        return False
    return True


def test_every_finding_of_the_boot_stage_has_its_words() -> None:
    assert set(REASONS) == set(IMAGE_STATUS_NAMES.values()) - {IMAGE_OK}


def test_the_image_as_built_is_taken(boot_stage: BootStage) -> None:
    assert boot_stage.verdict(image()) == ("", "OK")
    assert host_takes(image())


def test_each_check_refuses_what_it_is_for_and_so_does_the_host(boot_stage: BootStage) -> None:
    for name, damaged in damaged_images(image()).items():
        assert boot_stage.verdict(damaged.image) == (damaged.part, damaged.status), name
        assert not host_takes(damaged.image), name


@pytest.mark.parametrize("region", [APPLICATION, CALIBRATION], ids=["application", "calibration"])
def test_every_bit_of_a_header_is_protected(boot_stage: BootStage, region: Any) -> None:
    start = 8 * region.address
    for bit in range(start, start + 8 * HEADER_LENGTH):
        damaged = flipped(image(), bit)
        assert boot_stage.verdict(damaged) != ("", "OK"), f"bit {bit - start}"
        assert not host_takes(damaged), f"bit {bit - start}"


def test_no_bit_of_a_large_sample_goes_unnoticed(boot_stage: BootStage) -> None:
    content, draw = image(), random.Random(1)
    used_end = APPLICATION.address + Header.parse(content[APPLICATION.address :]).length
    record_end = FLOOR.address + FLOOR_LENGTH
    for bit in draw.sample(range(8 * len(content)), SAMPLE):
        damaged = flipped(content, bit)
        assert not host_takes(damaged), f"bit {bit}"
        place = bit // 8
        erased = used_end <= place < APPLICATION.end or record_end <= place < FLOOR.end
        if not erased:  # room that no part has
            assert boot_stage.verdict(damaged) != ("", "OK"), f"bit {bit}"


def test_no_truncated_or_longer_image_is_taken(boot_stage: BootStage) -> None:
    content, draw = image(), random.Random(2)
    ends = {0, 1, BOOT.end, APPLICATION.end, CALIBRATION.address + 1, len(content) - 1}
    for end in ends | set(draw.sample(range(len(content)), 100)):
        assert not host_takes(content[:end]), f"{end} bytes"
        # Of what is cut off, erased flash stays; a last byte that looks erased is no loss.
        if content[end:].strip(b"\xff"):
            assert boot_stage.verdict(content[:end]) != ("", "OK"), f"{end} bytes"
    for tail in (b"\xff", b"\x00", content):
        assert not host_takes(content + tail)


@pytest.mark.parametrize("length", [60, 64, 200, 1000, 2000])
def test_a_calibration_part_that_ends_before_its_model_is_refused(length: int) -> None:
    """With CRC and hash of what is there; the checks read nothing behind what is theirs."""
    content = image()
    _, calibration = parts(content)
    assert length < len(calibration)
    short = resealed(calibration[:length], length=length)
    with pytest.raises(InputError, match="calibration"):
        check_calibration(short, content, "part")


class GuardedMemory:
    """A part aligned as in flash, behind whose last double word nobody reads and goes on."""

    def __init__(self, content: bytes) -> None:
        content += bytes(-len(content) % 8)
        room = -(-len(content) // mmap.PAGESIZE) * mmap.PAGESIZE
        self._map = mmap.mmap(-1, room + mmap.PAGESIZE)
        self._map[room - len(content) : room] = content
        start = ctypes.addressof(ctypes.c_char.from_buffer(self._map))
        self.address = start + room - len(content)
        protect = ctypes.CDLL(None, use_errno=True).mprotect
        protect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
        assert protect(start + room, mmap.PAGESIZE, 0) == 0


def verdict_in_a_process_of_its_own(boot_stage: BootStage, part: bytes, header: bytes) -> int:
    """What the check of a calibration says; -11 where it reads behind the part."""
    memory = GuardedMemory(part)
    child = os.fork()
    if child == 0:
        os._exit(boot_stage.calibration_status_at(memory.address, len(part), header))
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("sizes_fit", [True, False], ids=["sizes", "sizes beyond all bounds"])
@pytest.mark.parametrize("short_by", [4, 0, -4])
def test_sizes_of_a_model_are_read_only_where_the_part_has_them(
    boot_stage: BootStage, short_by: int, sizes_fit: bool
) -> None:
    """Both sides of the shortest calibration: all that every model has, and no table."""
    application, calibration = parts(image())
    shortest = HEADER_LENGTH + MODEL_OFFSET + TABLES_OFFSET
    if not sizes_fit:
        layers = HEADER_LENGTH + MODEL_OFFSET
        calibration = calibration[:layers] + b"\xff" * 4 + calibration[layers + 4 :]
    part = resealed(calibration[: shortest - short_by], length=shortest - short_by)
    status = verdict_in_a_process_of_its_own(boot_stage, part, application[:HEADER_LENGTH])
    expected = "IMAGE_WRONG_LENGTH" if short_by > 0 else "IMAGE_WRONG_CONTENT"
    assert IMAGE_STATUS_NAMES.get(status, f"signal {-status}") == expected


@pytest.mark.parametrize("length", [56, 64, 200, 1000])
def test_the_check_reads_nothing_behind_a_part(boot_stage: BootStage, length: int) -> None:
    application, calibration = parts(image())
    part = resealed(calibration[:length], length=length)
    status = verdict_in_a_process_of_its_own(boot_stage, part, application[:HEADER_LENGTH])
    assert IMAGE_STATUS_NAMES.get(status, f"signal {-status}") == "IMAGE_WRONG_LENGTH"


def test_a_part_that_ends_where_its_model_would_begin_is_refused(boot_stage: BootStage) -> None:
    """Erased flash behind it is no model of no length."""
    content = image()
    _, calibration = parts(content)
    end = HEADER_LENGTH + MODEL_OFFSET
    part = resealed(calibration[:end], length=end)
    short = content[: CALIBRATION.address] + part
    assert boot_stage.verdict(short) == ("CALIBRATION", "WRONG_LENGTH")
    assert not host_takes(short)


def test_a_shorter_calibration_of_an_older_layout_is_told_by_its_layout(
    boot_stage: BootStage,
) -> None:
    content = image()
    application, calibration = parts(content)
    layout = Header.parse(application).calibration_layout - 1
    old = struct.pack("<I", layout) + calibration[HEADER_LENGTH + 4 : 400]
    part = resealed(calibration[:HEADER_LENGTH] + old, length=400, calibration_layout=layout)
    verdict = boot_stage.verdict(content[: CALIBRATION.address] + part)
    assert verdict == ("CALIBRATION", "WRONG_CALIBRATION_LAYOUT")


def test_noise_is_refused(boot_stage: BootStage) -> None:
    draw = random.Random(3)
    for length in (0, 40, 10_000, len(image())):
        noise = draw.randbytes(length)
        assert boot_stage.verdict(noise) != ("", "OK")
        assert not host_takes(noise)


@pytest.mark.parametrize("check", MUTANTS)
def test_a_check_that_is_taken_away_is_missed(check: str, tmp_path: Path) -> None:
    change = ("image.c", *MUTANTS[check])
    broken = BootStage(*load_library(tmp_path, SOURCES, HEADERS, change))
    found = {name: (d, broken.verdict(d.image)) for name, d in damaged_images(image()).items()}
    assert any(verdict != (d.part, d.status) for d, verdict in found.values()), "nobody noticed"
