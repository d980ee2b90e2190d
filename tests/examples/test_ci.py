"""examples/ci: the script runs a charge and fault rows and leaves JUnit; the workflow calls it."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml

from bms.native_build import ROOT
from tests.examples.shell import run

EXAMPLE = ROOT / "examples" / "ci"
SCRIPT = EXAMPLE / "charge_and_faults.sh"
WORKFLOW = EXAMPLE / "workflow.yml"
SCHEMA_CHECK = "check_jsonschema"
needs_schema_check = pytest.mark.skipif(
    importlib.util.find_spec(SCHEMA_CHECK) is None and "CI" not in os.environ,
    reason="not run: check-jsonschema is not installed; pip install check-jsonschema",
)


@pytest.mark.slow
def test_the_script_charges_plays_the_rows_and_leaves_a_case_for_each(tmp_path: Path) -> None:
    done = run([SCRIPT, "out", "--rows", "lost once", "--jobs", "1"], tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    summary = json.loads((tmp_path / "out" / "charge" / "summary.json").read_text())
    assert (summary["stop_reason"], summary["limits_kept"]) == ("complete", True)
    (suite,) = ElementTree.parse(tmp_path / "out" / "faults" / "junit.xml").getroot()
    matrix = json.loads((tmp_path / "out" / "faults" / "fault-matrix.json").read_text())
    names = [row["name"] for row in matrix["results"]]
    assert {"lost once: Coolant", "lost once: CellThermal"} < {*names}
    assert [(case.tag, case.get("name"), len(case)) for case in suite] == [
        ("testcase", name, 0) for name in names
    ]


@pytest.mark.parametrize(
    ("charge_code", "matrix_code", "code"), [(0, 0, 0), (1, 0, 1), (0, 1, 1), (1, 1, 1), (0, 2, 2)]
)
def test_the_script_runs_both_commands_and_fails_when_either_does(
    tmp_path: Path, charge_code: int, matrix_code: int, code: int
) -> None:
    bms = f'#!/bin/sh\necho "$@"\n[ "$1" != sil ] || exit {charge_code}\nexit {matrix_code}\n'
    done = run([SCRIPT, "out", "--rows", "lost once"], tmp_path, bms)
    assert done.stdout.splitlines() == [
        "sil --out out/charge",
        "fault-matrix --rows lost once --out out/faults",
    ]
    assert done.returncode == code


def test_without_a_folder_the_script_says_how_it_is_called() -> None:
    done = subprocess.run([SCRIPT], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "usage: charge_and_faults.sh OUT" in done.stderr


def steps() -> list[dict[str, Any]]:
    (job,) = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))["jobs"].values()
    return list(job["steps"])


def test_the_workflow_calls_the_script_and_publishes_what_it_leaves() -> None:
    (call,) = (step["run"].split() for step in steps() if SCRIPT.name in step.get("run", ""))
    program, out = call
    assert (ROOT / program).samefile(SCRIPT)
    assert os.access(SCRIPT, os.X_OK)
    published = [
        step["with"].get("report_paths") for step in steps() if "report" in step.get("uses", "")
    ]
    assert published == [f"{out}/faults/junit.xml"]
    (upload,) = (step for step in steps() if "upload-artifact" in step.get("uses", ""))
    assert upload["with"]["path"] == out


def test_reports_are_published_when_the_script_fails_too() -> None:
    names = [step.get("run") or step["uses"] for step in steps()]
    after = steps()[next(i for i, name in enumerate(names) if SCRIPT.name in name) + 1 :]
    assert len(after) == 2
    assert {step.get("if") for step in after} == {"always()"}


@needs_schema_check
def test_the_workflow_is_one_by_githubs_schema(tmp_path: Path) -> None:
    command = [sys.executable, "-m", SCHEMA_CHECK, "--builtin-schema", "vendor.github-workflows"]
    done = subprocess.run([*command, WORKFLOW], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    broken = tmp_path / "broken.yml"
    broken.write_text(WORKFLOW.read_text().replace("runs-on:", "runs_on:"))
    assert subprocess.run([*command, broken], capture_output=True, check=False).returncode == 1
