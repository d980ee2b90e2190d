"""The image: where its parts stand, what their headers say, and that every build gives the same."""

from __future__ import annotations

import shutil
import struct
import subprocess
import zlib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.firmware._firmware import ffi, lib
from bms.image import MEMORY_MAP, TARGETS, Header, calibration_of, calibration_part, check_image
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from bms.tables import network_tables
from tests.firmware.ports import BOARDS, CROSS, ROOT, build, built, image, needs_compiler

HEADER_FIELDS = 12
APPLICATION, CALIBRATION = MEMORY_MAP.application, MEMORY_MAP.calibration
COMPILER = [f"{CROSS}gcc", "-std=c99", "-mcpu=cortex-m4", "-mthumb", "-Werror"]
INCLUDES = [f"-I{ROOT / 'firmware_c' / folder}" for folder in ("include", "image")]

pytestmark = needs_compiler


def output(*command: object) -> str:
    return subprocess.run([*map(str, command)], check=True, capture_output=True, text=True).stdout


def section(elf: Path, name: str, folder: Path) -> bytes:
    raw = folder / "section.bin"
    output(f"{CROSS}objcopy", "-O", "binary", "--only-section", name, elf, raw)
    return raw.read_bytes()


@pytest.mark.parametrize("target", BOARDS)
def test_the_boot_stage_would_start_it(target: str) -> None:
    check_image(image(target), BOARDS[target], "image")


@pytest.mark.parametrize("target", BOARDS)
@pytest.mark.parametrize("program", ["firmware", "boot"])
def test_python_knows_the_linker_s_memory_map(target: str, program: str) -> None:
    elf = built(target) / ("boot.elf" if program == "boot" else "unsealed.elf")
    lines = (line.split() for line in output(f"{CROSS}nm", elf).splitlines())
    symbols = {name: int(address, 16) for address, _, name in lines}
    for region in ("boot", "floor", "application", "calibration", "ram"):
        expected = getattr(MEMORY_MAP, region)
        assert symbols[f"image_{region}_start"] == expected.address
        assert symbols[f"image_{region}_end"] == expected.end


@pytest.mark.parametrize("target", BOARDS)
def test_headers_say_what_the_parts_are(target: str) -> None:
    content = image(target)
    preset, model = load_pair(DEFAULT_PRESET, None)
    hashes = (int(model.hash[:8], 16), int(preset.hash[:8], 16))
    for region, magic, board in (
        (APPLICATION, b"BMAP", TARGETS[BOARDS[target]]),
        (CALIBRATION, b"BMCA", 0),
    ):
        start = content[region.address :]
        words = struct.unpack_from(f"<{HEADER_FIELDS}I", start)
        header = Header.parse(start)
        assert words == tuple(getattr(header, name) for name in Header.__dataclass_fields__)
        assert start[:4] == magic
        assert header.crc32 == zlib.crc32(start[8 : header.length])
        assert header.target == board
        assert header.firmware_version == lib.BMS_FIRMWARE_VERSION
        assert header.calibration_layout == lib.BMS_CALIBRATION_LAYOUT
        assert (header.model_hash, header.preset_hash) == hashes
    assert Header.parse(calibration_of(content)).length == len(calibration_of(content))
    boot = content[: MEMORY_MAP.boot.end]
    assert int.from_bytes(boot[-4:], "little") == zlib.crc32(boot[:-4])


def test_the_header_s_fields_are_those_of_the_c_structure() -> None:
    fields = dict(ffi.typeof("image_header_t").fields)
    assert list(fields) == list(Header.__dataclass_fields__)
    assert [field.offset for field in fields.values()] == [4 * n for n in range(HEADER_FIELDS)]


@given(st.binary(max_size=200))
def test_the_checksum_is_that_of_zip_files(content: bytes) -> None:
    assert lib.image_crc32(content, len(content)) == zlib.crc32(content)


def fields_of(kind: Any, prefix: str = "") -> list[tuple[str, int]]:
    """(path, offset) of every scalar and array in a structure."""
    found = []
    for name, field in kind.fields:
        path = f"{prefix}{name}"
        if field.type.kind == "struct":
            found += [(p, field.offset + o) for p, o in fields_of(field.type, f"{path}.")]
        else:
            found.append((path, field.offset))
    return found


@pytest.mark.parametrize("processor", ["cortex-m0", "cortex-m3", "cortex-m4"])
def test_the_calibration_has_the_same_layout_on_the_target(processor: str) -> None:
    kind = ffi.typeof("bms_calibration_t")
    claims = {f"offsetof(bms_calibration_t, {path})": at for path, at in fields_of(kind)}
    claims["sizeof(bms_calibration_t)"] = ffi.sizeof(kind)
    assert len(claims) > 40
    lines = [
        f"typedef char claim_{n}[({c} == {v}u) ? 1 : -1];"
        for n, (c, v) in enumerate(claims.items())
    ]
    source = '#include <stddef.h>\n#include "calibration.h"\n' + "\n".join(lines)
    command = [*COMPILER, f"-mcpu={processor}", *INCLUDES, "-fsyntax-only", "-x", "c", "-"]
    subprocess.run(command, input=source, text=True, check=True)


def test_the_calibration_built_in_is_the_one_that_python_makes(tmp_path: Path) -> None:
    part = calibration_part(*load_pair(DEFAULT_PRESET, None))
    for target in BOARDS:
        elf = built(target) / "firmware.elf"
        header, block = (section(elf, f".calibration{s}", tmp_path) for s in ("_header", ""))
        assert header + block == part


def test_another_model_s_calibration_is_what_the_target_s_compiler_makes(
    bms: Any, tmp_path: Path
) -> None:
    code, _, error = bms("export", "--preset", "lin2014", "--out", tmp_path)
    assert code == 0, error
    source, target = tmp_path / "calibration_default.c", tmp_path / "calibration_default.o"
    output(*COMPILER, *INCLUDES, "-fdata-sections", "-c", source, "-o", target)
    block = section(target, ".rodata.BMS_DEFAULT_CALIBRATION", tmp_path)
    assert len(block) == ffi.sizeof("bms_calibration_t")
    part = (tmp_path / "calibration.bin").read_bytes()
    content = part[4 * HEADER_FIELDS :]
    assert block[: len(content)] == content
    assert not block[len(content) :].strip(b"\0"), "all that the tables hold"
    assert Header.parse(part).length == len(part)


def test_a_calibration_ends_with_the_tables_of_its_model() -> None:
    preset, model = load_pair(DEFAULT_PRESET, None)
    tables = network_tables(model.network)
    edges, cells = len(tables.edges), tables.cells
    fixed = ffi.offsetof("bms_calibration_t", "kan") + ffi.offsetof("kan_model_t", "tables")
    expected = 4 * HEADER_FIELDS + fixed + 4 * edges * (cells + 1 + 8 * cells)
    assert len(calibration_part(preset, model)) == expected


def from_hex(text: str) -> dict[int, int]:
    """Address -> byte of an Intel HEX file."""
    memory, base = {}, 0
    for line in text.split():
        record = bytes.fromhex(line[1:])
        assert sum(record) % 256 == 0, "checksum"
        length, address, kind = record[0], int.from_bytes(record[1:3], "big"), record[3]
        data = record[4 : 4 + length]
        if kind in (2, 4):
            base = int.from_bytes(data, "big") << (4 if kind == 2 else 16)
        elif kind == 0:
            memory |= {base + address + n: byte for n, byte in enumerate(data)}
    return memory


@pytest.mark.parametrize("target", BOARDS)
def test_hex_and_binary_hold_the_same_and_erased_flash_between(target: str) -> None:
    content = image(target)
    memory = from_hex((built(target) / "firmware.hex").read_text())
    assert max(memory) == len(content) - 1
    assert bytes(memory.get(n, 0xFF) for n in range(len(content))) == content


def test_a_build_in_another_folder_gives_the_same_bytes(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "firmware_c", tmp_path / "elsewhere" / "firmware_c")
    other, here = build("mps2_an386", tmp_path / "elsewhere"), built("mps2_an386")
    for name in ("firmware.elf", "firmware.hex", "firmware.bin", "firmware.map"):
        assert (other / name).read_bytes() == (here / name).read_bytes(), name
