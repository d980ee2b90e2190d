"""The main rows of the fault matrix over real SocketCAN, in the guest where the host has none."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from tests.hil_sim.test_faults_matrix import ROWS
from tests.hil_sim.test_vcan import HAS_GUEST, HAS_VCAN, MISSING, run_in_guest

pytestmark = pytest.mark.skipif(not (HAS_VCAN or HAS_GUEST or "CI" in os.environ), reason=MISSING)

MAIN = (
    "lost once: CellThermal",
    "lost for good:*",
    "delayed too long: Coolant",
    "frozen: CellElectrical",
    "two frames swapped: CellThermal",
    "corrupted for good: CellThermal byte 3",
    "id of another message",
    "wrong length: ChargeRequest, length 3",
    "masqueraded, counter frozen: CellElectrical",
    "bus off for a second",
    "flood at full load: between",
    "sensor not available: surface_temperature_K",
    "current sensor disagrees",
    "charger ignores",
    "ECU restarts: for_periods 1",
)
FAULTS = """
[[fault]]
kind = "message-masqueraded"
message = "CellThermal"
from_s = 3
"""
SCRIPT = """
# python-can imports asammdf where it is, which takes seconds here and is not needed.
bms=("$PYTHON" -c 'import sys; sys.modules["asammdf"] = None; from bms.cli import main; main()')
bus=(--bus socketcan:vcan0)
"${bms[@]}" fault-matrix "${bus[@]}" ROWS --json > matrix.json; echo $? > matrix.status

"${bms[@]}" ecu "${bus[@]}" --silence-s 1 > ecu.out &
"${bms[@]}" plant "${bus[@]}" --faults faults.toml --json > plant.json; echo $? > plant.status
wait
"""


@pytest.fixture(scope="module")
def guest(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("faults_vcan")
    (folder / "faults.toml").write_text(FAULTS)
    rows = " ".join(f"--rows '{pattern}'" for pattern in MAIN)
    done = run_in_guest("bash", "-c", SCRIPT.replace("ROWS", rows), folder=folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_the_main_rows_are_as_expected_on_a_real_bus(guest):
    content = json.loads((guest / "matrix.json").read_text())
    assert content["bus"] == "socketcan:vcan0"
    assert [row["name"] for row in content["results"] if row["failures"]] == []
    assert (guest / "matrix.status").read_text().strip() == "0"
    names = [row.name for row in ROWS]
    assert [row["name"] for row in content["results"]] == [
        name for name in names if name in {row["name"] for row in content["results"]}
    ]
    assert len(content["results"]) >= len(MAIN)


def test_a_fault_of_the_plant_is_noticed_by_an_ecu_in_another_process(guest):
    summary = json.loads((guest / "plant.json").read_text())
    assert (guest / "plant.status").read_text().strip() == "1"
    assert (summary["stop_reason"], summary["first_fault"]) == ("fault", 1)
    assert summary["faults"][0]["kind"] == "message-masqueraded"
    assert summary["limits_kept"] is True
