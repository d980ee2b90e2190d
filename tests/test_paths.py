"""A path that may not even be looked at is one line and exit code 2, in every command."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

BMS = (sys.executable, "-c", "from bms.cli import main; main()")
# Without these the superuser has no more rights over files than their owner.
RIGHTS = "-dac_override,-dac_read_search"
AS_OWNER = ("setpriv", "--bounding-set", RIGHTS, "--inh-caps", RIGHTS)

COMMANDS = {
    "sil, preset": ("sil", "--preset", "LOCKED.toml"),
    "sil, model": ("sil", "--model", "LOCKED"),
    "sil, faults": ("sil", "--faults", "LOCKED"),
    "sil, out": ("sil", "--max-time-s", "1", "--out", "LOCKED"),
    "sil, log": ("sil", "--max-time-s", "1", "--log", "LOCKED/run.log"),
    "replay": ("replay", "LOCKED.log"),
    "evaluate": ("evaluate", "--preset", "lin2014", "--model", "LOCKED"),
    "train, data": ("train", "--data", "LOCKED", "--out", "model.json"),
    "train, out": ("train", "--preset", "lin2014", "--out", "LOCKED"),
    "explain": ("explain", "--model", "LOCKED", "--out", "out"),
    "bound": ("bound", "--model", "LOCKED"),
    "verify-tables": ("verify-tables", "--model", "LOCKED"),
    "compare-estimators": ("compare-estimators", "--data", "LOCKED"),
    "export": ("export", "--preset", "lin2014", "--out", "LOCKED"),
    "campaign": ("campaign", "--runs", "1", "--max-time-s", "5", "--out", "LOCKED"),
    "reproduce": ("reproduce", "--max-time-s", "1", "--out", "LOCKED"),
    "fault-matrix": ("fault-matrix", "--rows", "lost once*", "--jobs", "1", "--out", "LOCKED"),
    "compare-targets": ("compare-targets", "--build", "LOCKED"),
    "flash": ("flash", "--image", "LOCKED"),
    "bench": ("bench", "--quick", "--section", "decision", "--preset", "LOCKED.toml"),
    "cost": ("cost", "--out", "LOCKED/cost.png"),
    "plating": ("plating", "--temperatures", "0,1", "--out", "LOCKED/map.toml"),
    "identify, data": ("identify", "--data", "LOCKED"),
    "identify, preset": ("identify", "--data", "run.csv", "--preset", "LOCKED.toml"),
    "import-pykan": ("import-pykan", "LOCKED", "--out", "model.json"),
    "cell, preset": ("cell", "--preset", "LOCKED.toml", "--out", "out"),
    "cell, out": ("cell", "--preset", "lin2014", "--out", "LOCKED"),
    "preset new": ("preset", "new", "mine", "--out", "LOCKED.toml"),
    "preset check": ("preset", "check", "LOCKED.toml"),
    "preset diff": ("preset", "diff", "lin2014", "LOCKED.toml"),
    "ecu": ("ecu", "--bus", "udp_multicast:239.74.163.87", "--preset", "LOCKED.toml"),
    "plant": ("plant", "--bus", "udp_multicast:239.74.163.87", "--log", "LOCKED/run.log"),
    "monitor": ("monitor", "--bus", "udp_multicast:239.74.163.87", "--preset", "LOCKED.toml"),
    "dashboard": ("dashboard", "--preset", "LOCKED.toml"),
    "verify": ("verify", "--preset", "LOCKED.toml"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_path_in_a_locked_folder_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    if os.geteuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("the superuser may look at everything, and there is no setpriv")
    locked = tmp_path / "a locked folder"
    locked.mkdir(mode=0o000)
    arguments = [word.replace("LOCKED", str(locked / "x")) for word in COMMANDS[name]]
    prefix = AS_OWNER if os.geteuid() == 0 else ()
    done = subprocess.run(
        [*prefix, *BMS, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    (line,) = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "")
    assert line.startswith("bms: ")
    assert str(locked / "x") in line
