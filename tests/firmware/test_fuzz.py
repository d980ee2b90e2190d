"""The fuzzer of the ECU: nothing found in a short run, deep enough, and it can find something."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from bms.firmware._firmware import lib
from tests.firmware.native.build import ROOT, build_program

FRAMES = 2_000_000
INVALID_DECISION = f"fault_{lib.FAULT_DECISION_INVALID}"


def run(program: Path, frames: int, seed: int) -> subprocess.CompletedProcess[str]:
    command = [program, str(frames), str(seed)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def reached(output: str) -> dict[str, dict[str, int]]:
    """Numbers by subject and label."""
    rows = (line.split() for line in output.splitlines())
    return {name: dict(zip(rest[::2], map(int, rest[1::2]))) for name, *rest in rows}


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_program("fuzz", tmp_path_factory.mktemp("fuzz"), sanitize=True)


def test_no_finding_and_everything_is_reached(program: Path) -> None:
    result = run(program, FRAMES, seed=1)
    assert result.returncode == 0, result.stderr
    found = reached(result.stdout)
    run_of = found["run"]
    assert run_of["frames"] >= FRAMES
    assert run_of["periods_with_current"] > 0.3 * run_of["periods"]
    assert run_of["charges"] > 1000
    faults = {name: row for name, row in found.items() if name.startswith("fault_")}
    assert len(faults) == lib.FAULT_COUNT
    # No frame makes a decision invalid that is not stopped for its readings already.
    assert faults.pop(INVALID_DECISION)["periods"] == 0
    for name, row in found.items():
        if name != INVALID_DECISION:
            assert row["periods"] > 0 if name in faults else min(row.values()) > 0, name
    assert sum(row["latched_first"] > 0 for row in faults.values()) >= 15


def test_a_seed_gives_the_same_run(program: Path) -> None:
    first, second, other = (run(program, 20_000, seed).stdout for seed in (2, 2, 3))
    assert first == second != other


@pytest.mark.parametrize(
    ("source", "old", "new", "finding", "sanitize"),
    [
        ("bms.c", "!bms->monitor.stop &&", "", "current in spite of", False),
        (
            "e2e.c",
            "length != expected_length",
            "length < expected_length",
            "AddressSanitizer",
            True,
        ),
    ],
    ids=["symptoms ignored", "length ignored"],
)
def test_a_broken_firmware_is_found(
    source: str, old: str, new: str, finding: str, sanitize: bool, tmp_path: Path
) -> None:
    shutil.copytree(ROOT / "firmware_c", tmp_path / "firmware_c")
    path = tmp_path / "firmware_c" / "src" / source
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    result = run(build_program("fuzz", tmp_path, sanitize, tree=tmp_path), 1_000_000, seed=1)
    assert result.returncode != 0
    assert finding in result.stderr


def test_the_benchmark_names_its_parts_and_they_make_up_the_whole(tmp_path: Path) -> None:
    program = build_program("benchmark", tmp_path, sanitize=False)
    result = subprocess.run([program, "50"], capture_output=True, text=True, check=True)
    rows = [line.split() for line in result.stdout.splitlines()[1:]]
    shares = {name: float(percent) for name, _, percent in rows}
    assert shares.pop("whole") == 100.0
    assert sum(shares.values()) == pytest.approx(100.0, abs=0.5)
