"""A path that may not even be looked at is one line and exit code 2, in every command."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

# What the commands need is loaded once; each command runs in a fork of that, its output in files.
FORKS = """
import json, os, sys, traceback
from importlib.metadata import entry_points
from bms.cli import main
from bms.imports import left_out
with left_out("asammdf"):
    for entry in entry_points(group="bms.commands"):
        entry.load()

def run(words, folder, out, err):
    os.chdir(folder)
    for path, number in (os.devnull, 0), (out, 1), (err, 2):
        os.dup2(os.open(path, os.O_RDWR | os.O_CREAT), number)
    sys.argv = ["bms", *words]
    code = 0
    try:
        main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)

for line in sys.stdin:
    child = os.fork()
    if child == 0:
        run(*json.loads(line))
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
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


@pytest.fixture(scope="module")
def forks() -> Iterator[subprocess.Popen[str]]:
    """A process without a superuser's rights that runs each command it is given in a fork."""
    if os.geteuid() == 0 and shutil.which("setpriv") is None:
        pytest.skip("the superuser may look at everything, and there is no setpriv")
    prefix = AS_OWNER if os.geteuid() == 0 else ()
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(
        [*prefix, sys.executable, "-c", FORKS],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        yield process


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_path_in_a_locked_folder_is_refused_in_one_line(
    name: str,
    forks: subprocess.Popen[str],
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    locked = tmp_path / "a locked folder"
    locked.mkdir(mode=0o000)
    arguments = [word.replace("LOCKED", str(locked / "x")) for word in COMMANDS[name]]
    said = tmp_path_factory.mktemp("said")
    assert forks.stdin is not None
    assert forks.stdout is not None
    places = (str(tmp_path), str(said / "out"), str(said / "err"))
    print(json.dumps([arguments, *places]), file=forks.stdin, flush=True)
    code = int(forks.stdout.readline())
    (line,) = (said / "err").read_text(encoding="utf-8").splitlines()
    assert (code, (said / "out").read_text(encoding="utf-8")) == (2, "")
    assert line.startswith("bms: ")
    assert str(locked / "x") in line
