"""examples/own_cell: a plant in a package of one's own is found by its name and charged."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bms.native_build import ROOT

PROGRAM = "from bms.cli import main; main()"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example as pip installs it."""
    folder = tmp_path_factory.mktemp("own_cell")
    shutil.copytree(ROOT / "examples" / "own_cell", folder / "source")
    options = ("--no-deps", "--no-build-isolation", "--no-index", "--target")
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "-q", *options, folder / "site", "./source"],
        cwd=folder,
        check=True,
        capture_output=True,
    )
    return folder / "site"


def charged(plant: str, *folders: Path, max_time_s: float = 20) -> tuple[int, str, str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, [ROOT, *folders]))}
    options = ("--preset", "lin2014", "--json", "--max-time-s", str(max_time_s))
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, "sil", "--plant", plant, *options],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def test_the_installed_example_is_charged_and_obeys_its_own_equations(site: Path) -> None:
    code, printed, error = charged("own-cell:0.009", site)
    assert code == 1
    assert "time ended before the charge" in error
    summary = json.loads(printed)
    assert (summary["plant"], summary["stop_reason"]) == ("own-cell:0.009", "time-limit")
    assert summary["min_anode_potential_V"] is None
    # One mass: core and surface are the same, as with no other plant.
    assert summary["max_core_temperature_K"] == summary["max_surface_temperature_K"] > 299.0
    # At 23 A the resistance alone drops 207 mV, the branch up to 92 mV more.
    open_circuit_V = 3.25 + 0.1 * summary["final_soc"]
    assert open_circuit_V + 0.207 < summary["max_voltage_V"] < open_circuit_V + 0.207 + 0.092


def test_its_argument_is_checked_by_itself(site: Path) -> None:
    code, printed, error = charged("own-cell:much", site)
    assert (code, printed) == (2, "")
    assert error == (
        "bms: --plant own-cell:much: give the resistance in ohm, such as own-cell:0.009\n"
    )


def test_without_the_package_its_name_is_unknown() -> None:
    code, printed, error = charged("own-cell:0.009")
    assert (code, printed, error.count("\n")) == (2, "", 1)
    assert "no plant 'own-cell'; take one of two-mass, pybamm, recorded, fmu, or install" in error
