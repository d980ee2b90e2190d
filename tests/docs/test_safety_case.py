"""Requirements of the safety case are traced to goals, code and tests, and tests to them."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hil_sim.fault_matrix.matrix import matrix_path
from tests.docs.pages import ROOT
from tools.long_checks import load_checks
from tools.traceability_page import PAGE, load_items, traceability_page

GOALS, REQUIREMENTS = load_items()
SHOWN_BY_TESTS = ("firmware/test_*.py", "hil_sim/test_faults_m*.py", "bms/test_verification.py")
"""Tests of the product that a requirement has to ask for; others are of studies and tools."""


def doorstop(root: Path) -> subprocess.CompletedProcess[str]:
    command = [Path(sys.executable).parent / "doorstop", "-j", root, "--error-all", "-F", "-q"]
    return subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)


def test_links_files_and_words_are_there_and_every_text_has_been_reviewed() -> None:
    done = doorstop(ROOT)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (("def test_infeasible_states_give_zero", "def test_no_such"), "reference not found"),
        (("shall command 0 A", "may command 1 A"), "unreviewed changes"),
        (("- SG001:", "- SG099:"), "no item with UID: SG099"),
    ],
)
def test_what_is_not_there_or_not_reviewed_fails(wrong, said, tmp_path: Path) -> None:
    copy = tmp_path / "case"
    command = ["git", "clone", "--quiet", "--shared", ROOT, copy]
    subprocess.run(command, check=True)
    shutil.copytree(ROOT / "docs" / "safety", copy / "docs" / "safety", dirs_exist_ok=True)
    item = copy / "docs/safety/requirements/REQ002.yml"
    text = item.read_text(encoding="utf-8")
    assert wrong[0] in text
    item.write_text(text.replace(*wrong), encoding="utf-8")
    done = doorstop(copy)
    assert done.returncode == 1
    assert said in done.stderr


@pytest.mark.parametrize("one", REQUIREMENTS, ids=lambda one: one.uid)
def test_a_requirement_has_a_goal_code_and_a_test(one) -> None:
    assert one.goals
    assert one.code
    assert one.tests


def test_every_goal_has_requirements() -> None:
    met = {goal for one in REQUIREMENTS for goal in one.goals}
    assert met == {goal.uid for goal in GOALS}


def test_every_test_of_the_firmware_belongs_to_a_requirement() -> None:
    asked_for = {path for one in REQUIREMENTS for path, _ in one.tests}
    there = {
        path.relative_to(ROOT).as_posix()
        for pattern in SHOWN_BY_TESTS
        for path in (ROOT / "tests").glob(pattern)
    }
    assert there - asked_for == set()


def test_every_row_of_the_fault_matrix_belongs_to_a_requirement() -> None:
    asked_for = {row for one in REQUIREMENTS for row in one.rows}
    there = re.findall(r'^name = "(.*)"$', matrix_path().read_text(encoding="utf-8"), re.M)
    assert set(there) == asked_for


def test_kept_results_that_are_named_exist() -> None:
    named = {name for one in REQUIREMENTS for name in one.kept}
    assert named <= {check.name for check in load_checks()}


def test_the_page_is_the_one_that_the_items_make() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == traceability_page(), "run python -m tools.traceability_page"
    for item in (*GOALS, *REQUIREMENTS):
        assert f"## {item.uid}\n\n**{item.title}.** {item.text}" in page
