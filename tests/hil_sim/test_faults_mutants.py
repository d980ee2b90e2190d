"""A firmware that ignores one fault turns exactly the rows of the matrix red that rest on it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.firmware.mutation import CompiledFirmware
from tests.hil_sim.test_faults_matrix import ROWS, is_quick

ROOT = Path(__file__).parents[2]
MATRIX = "tests/hil_sim/test_faults_matrix.py"
NEVER = "{ 255u, false, 0u }"
GOES_ON = "    (BIT(FAULT_CURRENT_DEVIATION) |"
"""Begin of the set of faults that do not stop at once, which says the same as the policy."""

# Name of the fault, its row of the policy, and the message whose loss it stands for.
IGNORED = [
    ("thermal-missing", "[FAULT_THERMAL_MISSING] = { 3u, true, 0u }", "CellThermal"),
    ("current-deviation", "[FAULT_CURRENT_DEVIATION] = { 3u, false, 0u }", None),
    ("corrupted-frames", "[FAULT_CORRUPTED_FRAMES] = { 3u, false, 5u }", None),
]


def rests_on(row, name, message):
    """Whether a row expects this fault, or the pause that its symptom makes."""
    if row.expect.latches is not None:
        return row.expect.latches == name
    pauses = row.expect.reaction == "resumes" and row.expect.deadline_periods is not None
    return pauses and message is not None and getattr(row.fault, "message", None) == message


QUICK = [row for row in ROWS if is_quick(row) and not row.realtime]
EVERY_SO_MANY = 10


@pytest.mark.long("faults")
@pytest.mark.parametrize(("name", "policy", "message"), IGNORED, ids=lambda value: value)
def test_exactly_the_rows_of_an_ignored_fault_are_red(name, policy, message, tmp_path):
    expected = {row.name for row in QUICK if rests_on(row, name, message)}
    assert red_rows([row.name for row in QUICK], policy, tmp_path) == expected


@pytest.mark.slow
@pytest.mark.parametrize(("name", "policy", "message"), IGNORED, ids=lambda value: value)
def test_of_a_choice_of_rows_those_of_an_ignored_fault_are_red(name, policy, message, tmp_path):
    expected = {row.name for row in QUICK if rests_on(row, name, message)}
    others = [row.name for row in QUICK if row.name not in expected][::EVERY_SO_MANY]
    assert red_rows([*expected, *others], policy, tmp_path) == expected


def red_rows(names, policy, tmp_path):
    """Rows that fail with a firmware without this row of its policy."""
    fault = policy[policy.index("[") + 1 : policy.index("]")]
    changes = {
        policy: policy[: policy.index("{")] + NEVER,
        GOES_ON: f"{GOES_ON} BIT({fault}) |",
    }
    build = CompiledFirmware.build(tmp_path / "base").variant_of_changes(
        "monitor.c", changes, tmp_path / "out"
    )
    python = [sys.executable, "-m"]
    run = [*python, "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    run += ["--firmware-build", str(build), f"--junitxml={tmp_path / 'junit.xml'}"]
    run += [f"{MATRIX}::test_quick_row[{name}]" for name in names]
    result = subprocess.run(run, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 1, result.stdout[-2000:]
    played = list(ElementTree.parse(tmp_path / "junit.xml").getroot().iter("testcase"))
    assert len(played) == len(names) > 0
    red = {case.get("name") for case in played if len(case)}
    return {name for name in names if f"test_quick_row[{name}]" in red}
