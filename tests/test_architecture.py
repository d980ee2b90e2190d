"""The plan: who imports whom, and that no test runs on a C library of other sources."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WINGS = ("bms", "codegen", "hil_sim")


def copied(folder: Path, *names: str) -> Path:
    for name in names:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def linted(tree: Path) -> subprocess.CompletedProcess[str]:
    command = [Path(sys.executable).with_name("lint-imports"), "--no-logo", "--no-cache"]
    environment = os.environ | {"PYTHONPATH": str(tree)}
    return subprocess.run(
        command, cwd=tree, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("module", "imported", "contract"),
    [
        ("bms/errors.py", "hil_sim.bus.closing", "hil_sim -> codegen -> bms"),
        ("codegen/rendering.py", "hil_sim.bus.closing", "hil_sim -> codegen -> bms"),
        ("bms/cell/model.py", "bms.studies.paper_fit.figures", "bms: product below"),
        ("bms/firmware/edges.py", "bms.verification.intervals", "bms: product below"),
        ("codegen/rendering.py", "codegen.can_sources", "codegen: programs over"),
        ("hil_sim/bus/buses.py", "hil_sim.run.session", "hil_sim: product below"),
        ("hil_sim/plant/plant.py", "hil_sim.logs.frame", "hil_sim: product below"),
        ("bms/cell/parameters.py", "bms.cell.model", "no circle of packages"),
    ],
)
def test_an_import_against_the_plan_breaks_its_contract(module, imported, contract, tmp_path):
    tree = copied(tmp_path, *WINGS)
    with (tree / module).open("a", encoding="utf-8") as file:
        file.write(f"\nimport {imported}\n")
    said = linted(tree)
    assert said.returncode == 1, said.stdout + said.stderr
    assert any(
        line.startswith(contract) and line.endswith("BROKEN") for line in said.stdout.splitlines()
    )


def test_a_new_package_has_to_be_given_its_layer(tmp_path):
    tree = copied(tmp_path, *WINGS)
    (tree / "bms" / "newcomer").mkdir()
    (tree / "bms" / "newcomer" / "__init__.py").touch()
    said = linted(tree)
    assert said.returncode == 1
    assert "newcomer" in said.stdout


def run_tests(tree: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    environment = os.environ | {"PYTHONPATH": str(tree)}
    return subprocess.run(
        [*command, "tests/firmware/test_soc.py"],
        cwd=tree,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_changed_c_source_stops_every_test_run_until_it_is_built(tmp_path):
    tree = copied(tmp_path, *WINGS, "firmware_c", "tests", "tools", "results")
    assert run_tests(tree).returncode == 0
    source = tree / "firmware_c" / "src" / "soc.c"
    text = source.read_text(encoding="utf-8")
    assert "-measured_A * period_s" in text
    source.write_text(text.replace("-measured_A * period_s", "measured_A * period_s"))
    said = run_tests(tree)
    assert said.returncode == pytest.ExitCode.USAGE_ERROR
    assert said.stdout == ""
    (line,) = said.stderr.strip().splitlines()
    assert "bms.firmware._firmware" in line
    assert "make build" in line
