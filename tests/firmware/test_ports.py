"""Every port: in the build table, built from the same sources, of the same few lines."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

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


@pytest.mark.parametrize("mark", ["needs_compiler", "needs_emulator"])
@pytest.mark.parametrize(("environment", "is_left_out"), [({}, "True"), ({"CI": "1"}, "False")])
def test_nothing_is_left_out_where_the_tests_are_ci(
    mark: str, environment: dict[str, str], is_left_out: str
) -> None:
    command = [
        sys.executable,
        "-c",
        f"from tests.firmware.ports import {mark} as m; print(m.args[0])",
    ]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={"PATH": "", **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == is_left_out


def script(path: Path, text: str) -> None:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@pytest.mark.parametrize(
    ("mode", "is_debian", "has_programs", "code"),
    [
        ("firmware", True, False, 1),
        ("firmware", True, True, 1),
        ("firmware", False, False, 1),
        ("firmware", False, True, 0),
        ("", True, False, 0),
        ("", False, False, 0),
    ],
)
def test_packages_that_cannot_be_installed_end_the_rule_that_needs_them(
    tmp_path: Path, mode: str, is_debian: bool, has_programs: bool, code: int
) -> None:
    """As a user who is not root, on Debian and elsewhere; only there they may be of other names."""
    script(tmp_path / "id", "echo 1000")
    if is_debian:
        script(tmp_path / "dpkg-query", "exit 1")
    for name in ("arm-none-eabi-gcc", "qemu-system-arm") if has_programs else ():
        script(tmp_path / name, "exit 0")
    command = ["/bin/sh", str(ROOT / "tools" / "debian_packages.sh"), *([mode] if mode else [])]
    done = subprocess.run(
        command, env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert done.returncode == code
    assert "run as root: apt-get install -y" in done.stderr


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
        names = {line.split(":=")[0].strip() for line in lines if ":=" in line}
        assert names - {"CORE_FLAGS"} == {"TARGET", "TARGET_ID", "CPU"}


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


@needs_compiler
def test_a_section_without_a_place_fails_the_build(tmp_path: Path) -> None:
    """The linker would put it somewhere, outside the checksums."""
    shutil.copytree(ROOT / "firmware_c", tmp_path / "firmware_c")
    source, function = (
        tmp_path / "firmware_c" / "src" / "bms.c",
        "bool bms_transmit(",
    )
    text = source.read_text()
    assert function in text
    source.write_text(text.replace(function, f'__attribute__((section(".odd"))) {function}'))
    with pytest.raises(subprocess.CalledProcessError) as failed:
        build("mps2_an386", tmp_path)
    assert "orphan section `.odd'" in failed.value.stderr


def test_the_core_and_the_loop_know_no_port() -> None:
    for path in (*(ROOT / "firmware_c").glob("port/*.[ch]"), *(ROOT / "firmware_c").glob("boot/*")):
        included = re.findall(r'#include ["<](.+)[">]', path.read_text())
        assert not {"registers.h", "start.h"} & set(included), path.name
