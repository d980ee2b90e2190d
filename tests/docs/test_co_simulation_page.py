"""The commands of docs/co-simulation.md in order, and what its tables name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bms.firmware import Ecu
from bms.presets import load_preset
from hil_sim.bus.catalog import FrameId
from hil_sim.fmu.driven_ecu import DrivenEcu
from hil_sim.fmu.plant_variables import plant_variables
from tests.docs.pages import ROOT
from tests.examples.shell import run

TEXT = (ROOT / "docs" / "co-simulation.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```sh\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Where the commands of the page have run."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "examples").symlink_to(ROOT / "examples")
    (folder / "run.sh").write_text("set -ex\n" + "\n".join(BLOCKS), encoding="utf-8")
    done = run(["sh", "run.sh"], folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("No problems found.") == 4
    assert "complete after" in done.stdout
    return folder


@pytest.mark.slow
def test_both_units_charge_as_the_bus_does_and_so_does_the_unit_as_plant(folder):
    logs = [(folder / f"out/{name}/can.log").read_bytes() for name in ("fmu", "sil", "own")]
    assert logs[0] == logs[1] == logs[2]
    assert len(logs[0].splitlines()) > 50_000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unit", "preset"), [("fmu/ecu.fmu", "paper_calibrated"), ("lin2014.fmu", "lin2014")]
)
def test_an_ecu_built_from_its_sources_or_with_another_calibration_answers_as_ours(
    folder, unit, preset
):
    """The first has the library that `fmpy compile` has put there."""
    driven = DrivenEcu(folder / "out" / unit, load_preset(preset).timing.sampling_period_s)
    ours = Ecu(preset)
    for _ in range(20):
        sync = [(int(FrameId.SYNC), b"")]
        assert driven.exchange(sync) == ours.exchange(sync)


def test_the_tables_of_the_page_name_the_variables_of_the_units():
    rows = "\n".join(line.split("|")[1] for line in TEXT.splitlines() if line.startswith("| `"))
    named = set(re.findall(r"`([\w.]+)`", rows))
    variables = {
        v.name for p in ("paper_calibrated", "samsung_30q") for v in plant_variables(load_preset(p))
    }
    of_branches = {v for v in variables if re.match(r"branch[23]_", v)}
    assert variables - of_branches - {"time"} <= named
    ecu = {f"Can.{name}" for name in ("Rx_Clock", "Rx_Data", "Tx_Clock", "Tx_Data")}
    files = {"ecu.fmu", "plant_fmi2.fmu", "plant_fmi3.fmu"}
    assert named - variables == ecu | files | {"Can.BusNotifications"}
