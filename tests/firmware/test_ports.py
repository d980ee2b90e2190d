"""Every port: in the build table, built from the same sources, of the same few lines."""

from __future__ import annotations

import re
import subprocess

import pytest

from bms.image import TARGETS
from tests.firmware.ports import BOARDS, PORTS, ROOT, build, needs_compiler

SHARED = {"cortex_m"}
"""Folders that several ports use; they are no targets."""
TABLE = re.findall(
    r"^FIRMWARE_TARGETS := (.+)$", (ROOT / "firmware_c" / "firmware.mk").read_text(), re.M
)[0].split()
PRODUCTS = {"linux": ("bms_ecu",)}
IMAGE = ("firmware.elf", "firmware.hex", "firmware.bin", "firmware.map")


def test_every_port_has_its_row_in_the_build_table() -> None:
    folders = {path.name for path in PORTS.iterdir() if path.is_dir()}
    assert sorted(TABLE) == sorted(folders - SHARED)


@needs_compiler
@pytest.mark.parametrize("target", TABLE)
def test_every_port_builds_within_its_budget(target: str) -> None:
    folder = build(target)
    for name in PRODUCTS.get(target, IMAGE):
        assert (folder / name).stat().st_size > 0


@pytest.mark.parametrize("target", BOARDS)
def test_the_host_knows_a_board_by_the_number_in_its_images(target: str) -> None:
    number = re.findall(r"^TARGET_ID := (\d+)$", (PORTS / target / "port.mk").read_text(), re.M)
    assert number == [str(TARGETS[BOARDS[target]])]


def test_the_host_knows_every_board() -> None:
    assert sorted(BOARDS.values()) == sorted(TARGETS)
    assert len(set(TARGETS.values())) == len(TARGETS)


def test_a_board_is_a_few_lines_of_make() -> None:
    for target in BOARDS:
        assert [path.name for path in (PORTS / target).iterdir()] == ["port.mk"]
        lines = (PORTS / target / "port.mk").read_text().splitlines()
        assert sum(":=" in line for line in lines) == 3


@needs_compiler
@pytest.mark.parametrize("target", BOARDS)
def test_no_operation_on_the_target_fuses_or_widens(target: str) -> None:
    """Float32 as on the host: no fused multiply-add anywhere, no double in the application."""
    elf = build(target) / "unsealed.elf"
    code = subprocess.run(
        ["arm-none-eabi-objdump", "-d", elf], capture_output=True, text=True, check=True
    ).stdout
    assert re.findall(r"\bvfn?m[as]\S*", code) == []
    assert re.findall(r"bl\s+\S+ <(__aeabi_d\w+)>", code) == []


def test_the_core_and_the_loop_know_no_port() -> None:
    for path in (*(ROOT / "firmware_c").glob("port/*.[ch]"), *(ROOT / "firmware_c").glob("boot/*")):
        included = re.findall(r'#include ["<](.+)[">]', path.read_text())
        assert not {"registers.h", "start.h"} & set(included), path.name
