"""What firmware_c/ promises about itself: warnings, symbols, memory, libraries."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[2] / "firmware_c"
SOURCES = sorted([*FIRMWARE.glob("src/*.c"), *FIRMWARE.glob("generated/*.c")])
AROUND = sorted(
    path for folder in ("image", "boot", "port") for path in FIRMWARE.glob(f"{folder}/*.c")
)
FOLDERS = ("include", "src", "generated", "image", "boot", "port")
INCLUDES = [f"-I{FIRMWARE / folder}" for folder in FOLDERS]
WARNINGS = (
    "-std=c99 -pedantic -Wall -Wextra -Werror -Wconversion -Wdouble-promotion -Wmissing-prototypes"
).split()
COMPILERS = [c for c in ("gcc", "clang", "clang-14") if shutil.which(c)]


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("source", [*SOURCES, *AROUND], ids=lambda path: path.name)
def test_no_warning(compiler: str, source: Path) -> None:
    subprocess.run([compiler, *WARNINGS, *INCLUDES, "-fsyntax-only", source], check=True)


@pytest.mark.parametrize(
    ("header", "number", "other"),
    [
        ("bms.h", "BMS_DERATED = 3", "BMS_DERATED = 6"),
        ("codec.h", "REQUEST_CHARGE = 1", "REQUEST_CHARGE = 2"),
        ("rcbf.h", "RCBF_INVALID = 6", "RCBF_INVALID = 7"),
        ("monitor.h", "FAULT_OUT_OF_STEP = 20", "FAULT_OUT_OF_STEP = 21"),
        ("monitor.h", "FAULT_NONE 255", "FAULT_NONE 254"),
        ("e2e.h", "E2E_VALID = 2, E2E_INVALID = 3", "E2E_VALID = 3, E2E_INVALID = 2"),
    ],
)
def test_a_number_that_is_not_the_database_s_does_not_compile(
    tmp_path: Path, header: str, number: str, other: str
) -> None:
    text = (FIRMWARE / "include" / header).read_text()
    assert number in text
    shutil.copytree(FIRMWARE / "include", tmp_path, dirs_exist_ok=True)
    (tmp_path / header).write_text(text.replace(number, other))
    command = ["gcc", *WARNINGS, f"-I{tmp_path}", *INCLUDES, "-fsyntax-only"]
    command.append(str(FIRMWARE / "src" / "choices.c"))
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    name, _, _ = number.partition(" ")
    assert done.returncode != 0
    assert f"{name}_is_" in done.stderr


@pytest.fixture(scope="module")
def symbols(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, str, str]]:
    """(object, kind, name) of every symbol, kind as `nm` prints it."""
    folder = tmp_path_factory.mktemp("objects")
    found = []
    for source in SOURCES:
        target = folder / f"{source.stem}.o"
        subprocess.run(["gcc", *WARNINGS, *INCLUDES, "-O2", "-c", source, "-o", target], check=True)
        listing = subprocess.run(["nm", target], check=True, capture_output=True, text=True).stdout
        found += [
            (source.stem, kind, name) for kind, name in re.findall(r" (\w) (\w+)$", listing, re.M)
        ]
    return found


PREFIXES = {"calibration_default": "bms"}


def test_exported_symbols_carry_their_module_s_prefix(symbols: list[tuple[str, str, str]]) -> None:
    for module, kind, name in symbols:
        if kind in "TDRB":
            prefix = PREFIXES.get(module, module.partition("_")[0])
            assert name.lower().startswith(prefix), f"{module}: {name}"


def test_no_mutable_data_outside_the_caller_s_structures(
    symbols: list[tuple[str, str, str]],
) -> None:
    assert [s for s in symbols if s[1] in "DdBbC"] == []


def test_nothing_of_the_c_library_but_sqrtf_and_block_copies(
    symbols: list[tuple[str, str, str]],
) -> None:
    defined = {name for _, kind, name in symbols if kind in "TtRr"}
    outside = {name for _, kind, name in symbols if kind == "U"} - defined
    assert outside <= {"sqrtf", "memcpy", "memset"}


def test_core_includes_no_port_and_no_system_header() -> None:
    allowed = {"float.h", "math.h", "stdbool.h", "stddef.h", "stdint.h"}
    for path in [*FIRMWARE.glob("src/*"), *FIRMWARE.glob("include/*")]:
        assert set(re.findall(r"#include <(.+)>", path.read_text())) <= allowed, path.name


@pytest.mark.parametrize(
    "path",
    [
        path
        for pattern in ("src/*", "include/*", "image/*", "boot/*")
        for path in FIRMWARE.glob(pattern)
    ]
    + [path for path in FIRMWARE.glob("port/**/*") if path.is_file()],
    ids=lambda p: p.name,
)
def test_files_stay_small(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 400
    assert path.stat().st_size <= 15_000
