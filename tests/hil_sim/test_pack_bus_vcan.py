"""A pack of 96 cells as two processes on a real SocketCAN bus, in the guest where there is none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bms.model.pair import load_pair
from hil_sim.logs.recorder import Recorder
from hil_sim.pack.budget import budget
from hil_sim.pack.charge import charge_pack
from hil_sim.pack.settings import PackChargeSettings

GUEST = Path(__file__).parents[2] / "tools" / "vcan_guest.sh"
HAS_VCAN = Path("/sys/class/net/vcan0").exists()
HAS_GUEST = Path("/usr/bin/linux.uml").exists()
MISSING = "no vcan0 and no user-mode-linux: apt-get install -y user-mode-linux"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (HAS_VCAN or HAS_GUEST or "CI" in os.environ), reason=MISSING),
]

CELLS, SEED, TIMEOUT_S = 96, 2, 240
MAX_TIME_S = 12.0
"""Until some seconds after the current has grown to its full strength."""
SCRIPT = f"""
# python-can imports asammdf where it is, which takes seconds here and is not needed.
bms=("$PYTHON" -c 'import sys; sys.modules["asammdf"] = None; from bms.cli import main; main()')
bus=(--cells {CELLS} --bus socketcan:vcan0)

"${{bms[@]}}" plant "${{bus[@]}}" --answer-timeout-s 0.1 2> alone.err; echo $? > alone.status

( "${{bms[@]}}" ecu "${{bus[@]}}" --silence-s 3 > ecu.out; echo $? > ecu.status ) &
charge=(--seed {SEED} --max-time-s {MAX_TIME_S} --out run --json)
"${{bms[@]}}" plant "${{bus[@]}}" "${{charge[@]}}" > plant.json
echo $? > plant.status
wait

( "${{bms[@]}}" ecu --cells 95 --bus socketcan:vcan0 --silence-s 3 > /dev/null ) &
"${{bms[@]}}" plant "${{bus[@]}}" 2> other.err; echo $? > other.status
wait
"""


@pytest.fixture(scope="module")
def guest(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pack_vcan")
    environment = {**os.environ, "PYTHON": sys.executable, "VCAN_TIMEOUT_S": str(TIMEOUT_S)}
    done = subprocess.run(
        [GUEST, "bash", "-c", SCRIPT], cwd=folder, env=environment, capture_output=True, text=True,
        check=False, timeout=TIMEOUT_S + 60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


def status(path):
    return int(path.read_text())


def test_two_processes_give_the_frames_of_the_virtual_bus(guest, tmp_path):
    preset, model = load_pair("paper_calibrated", None)
    settings = PackChargeSettings(preset, model, CELLS, seed=SEED, max_time_s=MAX_TIME_S)
    with Recorder(tmp_path / "can.log") as recorder:
        expected = charge_pack(settings, recorder)
    assert (guest / "run" / "can.log").read_bytes() == (tmp_path / "can.log").read_bytes()
    assert min(command for command in expected.commands_A if command is not None) < -22.0
    said = json.loads((guest / "plant.json").read_text())
    assert said["bus"] == "socketcan:vcan0"
    assert said["steps"] == expected.steps
    assert said["stop_reason"] == "time-limit"
    assert said["first_fault"] is None


def test_both_processes_end_well_and_the_ecu_saw_every_frame(guest):
    steps = json.loads((guest / "plant.json").read_text())["steps"]
    assert status(guest / "plant.status") == 1  # its time ended before the charge
    assert status(guest / "ecu.status") == 0
    # All of a period but the ECU's own frames: pages of three groups, three messages, SYNC.
    frames = (32 + 32 + 7 + 3 + 1) * steps
    assert frames < budget(CELLS).frames * steps
    assert f"{frames} frames received, {steps} steps" in (guest / "ecu.out").read_text()


def test_a_plant_without_an_ecu_says_how_to_start_one(guest):
    assert status(guest / "alone.status") == 2
    (line,) = (guest / "alone.err").read_text().splitlines()
    assert "'bms ecu --bus socketcan:vcan0' with the same --cells" in line


def test_an_ecu_of_another_number_of_cells_gets_no_charge(guest):
    assert status(guest / "other.status") == 2
    (line,) = (guest / "other.err").read_text().splitlines()
    assert "cells" in line
