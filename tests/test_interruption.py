"""Ctrl-C ends a command within 2 s: exit code 130, one line, no orphan, nothing half-written."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bms.model.model_file import shipped_model_path
from tests.bms.kan_samples import write_recording
from tests.firmware.ports import ROOT, built, needs_emulator

# What takes long tells how far it is; here from its first step on, which is its sign of life.
PROGRAM = (
    "import bms.waiting; bms.waiting.FIRST_LINE_S = 0.0; from bms.cli import main; main()"
)  # fmt: skip
SIGN_OF_LIFE_S = 120.0
END_S = 2.0
START_S = 1.0
"""Of a busy machine, on top."""

COMMANDS = {
    "verify-tables": ("verify-tables", "--stride", 1, "--processes", 2),
    "campaign": ("campaign", "--runs", 20_000, "--jobs", 2, "--out", "out"),
    "campaign in one process": ("campaign", "--runs", 20_000, "--jobs", 1, "--out", "out"),
    "pack": ("pack", "--packs", 5000, "--jobs", 2, "--out", "out"),
    "reproduce": ("reproduce", "--jobs", 2, "--out", "out"),
    "fault-matrix": ("fault-matrix", "--jobs", 2, "--out", "out"),
    "train": ("train", "--preset", "lin2014", "--out", "model.json"),
    "sil": ("sil", "--out", "out"),
    "verify": ("verify",),
    "cost": ("cost", "--out", "out"),
    "bench": ("bench",),
    "compare-estimators": ("compare-estimators", "--preset", "lin2014"),
    "identify": ("identify", "--data", "RECORDING", "--out", "cell.toml"),
    "explain": ("explain", "--model", "MODEL", "--out", "out"),
    "bound": ("bound", "--model", "MODEL", "--out", "out"),
    "cell": ("cell", "--preset", "lin2014", "--out", "out"),
    "plating": ("plating", "--out", "map.toml"),
    "replay": ("replay", "--against", "ROOT", "ROOT", "ROOT/tests/hil_sim/golden"),
    "compare-targets": ("compare-targets", "--target", "qemu:mps2-an386", "--build", "IMAGES"),
}
WITH_PROCESSES = (
    *("verify-tables", "campaign", "pack", "reproduce", "fault-matrix", "cell", "cost", "bench"),
    "compare-targets",
)
KEPT = {
    "campaign": {"campaign.json", "chunks"},
    "cell": {"cell.json", "preset.toml", "report.html"},
}
"""What `bms campaign --resume` and another call of `bms cell` go on with."""


def processes_of_group(group: int) -> list[str]:
    """Command lines of what still runs."""
    listing = subprocess.run(
        ["ps", "-e", "-o", "pgid=,stat=,args="], capture_output=True, text=True, check=True
    )
    rows = [line.split(maxsplit=2) for line in listing.stdout.splitlines()]
    return [args for pgid, stat, args in rows if int(pgid) == group and stat[0] != "Z"]


def arguments(name, folder):
    """Words of a command; what it reads is made in the folder."""
    places = {"MODEL": shipped_model_path("lin2014"), "ROOT": ROOT}
    if "RECORDING" in COMMANDS[name]:
        places["RECORDING"] = write_recording(folder / "run.csv", rows=2000)
    if "IMAGES" in COMMANDS[name]:
        places["IMAGES"] = built("mps2_an386").parent
    words = map(str, COMMANDS[name])
    return [re.sub("|".join(places), lambda found: str(places[found[0]]), word) for word in words]


def tried():
    """Each command as a terminal interrupts it, and alone too where it has processes of its own."""
    for name in COMMANDS:
        marks = needs_emulator if name == "compare-targets" else ()
        yield pytest.param(name, True, marks=marks, id=f"{name}-process group")
        if name in WITH_PROCESSES:
            yield pytest.param(name, False, marks=marks, id=f"{name}-main process")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "is_for_all"), list(tried()))
def test_ctrl_c_ends_a_command_at_once(name, is_for_all, tmp_path, tmp_path_factory):
    words = arguments(name, tmp_path_factory.mktemp("inputs"))
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *words],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        bufsize=0,
    ) as process:
        try:
            assert process.stderr is not None
            life = process.stderr.readline()
            start_s = time.monotonic()
            if is_for_all:
                os.killpg(process.pid, signal.SIGINT)
            else:
                process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=SIGN_OF_LIFE_S)
            took_s = time.monotonic() - start_s
            while processes_of_group(process.pid) and time.monotonic() < start_s + END_S + START_S:
                time.sleep(0.1)
            left = processes_of_group(process.pid)
        finally:
            for _ in processes_of_group(process.pid)[:1]:
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130, life + said
    assert said.decode().splitlines()[-1] == "bms: interrupted"
    assert "Traceback" not in said.decode()
    assert took_s < END_S + START_S
    assert left == []
    files = {path.name for path in Path(tmp_path).rglob("*") if path.parent.name != "chunks"}
    assert files - {"out"} <= KEPT.get(name.split()[0], set())


BUSY = """
import subprocess, sys
from bms.interruption import prompt_interrupts
with prompt_interrupts():
    child = subprocess.Popen(["sleep", "60"])
    words = iter(["ready"])
    while True:
        try:
            # Said in here, where the interrupt that answers it is swallowed.
            for word in words:
                print(word, flush=True)
            child.wait()
            {body}
        except KeyboardInterrupt:
            print("heard", flush=True)
"""
UNHANDLED = """
import subprocess
from bms.interruption import prompt_interrupts
try:
    with prompt_interrupts():
        child = subprocess.Popen(["sleep", "60"])
        print("ready", flush=True)
        child.wait()
except KeyboardInterrupt:
    raise SystemExit(130) from None
"""


def child_of(pid):
    return int(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()[0])


def has_ended(pid):
    """Whether a process ends in time. Nothing may collect it where its parent has gone before."""
    stat = Path(f"/proc/{pid}/stat")
    limit_s = time.monotonic() + START_S
    while time.monotonic() < limit_s:
        try:
            state = stat.read_text().rpartition(")")[2].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        if state in "ZX":
            return True
        time.sleep(0.01)
    return False


def interrupted(program):
    """Interrupts a program when it is ready: exit code, what it said, its child, seconds it took.

    The child holds the same pipes, so they are read to their end only when it has gone too.
    """
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        child = child_of(process.pid)
        start_s = time.monotonic()
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=30.0)
    return process.returncode, said, child, time.monotonic() - start_s


@pytest.mark.parametrize(
    "body",
    ["import ctypes; ctypes.CDLL(None).sleep(60)", "continue"],
    ids=["long call of C", "loop that swallows it"],
)
def test_what_does_not_end_by_itself_is_ended_with_its_children(body):
    code, said, child, took_s = interrupted(BUSY.format(body=body))
    assert (code, said) == (130, ("heard\n", "bms: interrupted\n"))
    assert took_s < END_S + START_S
    assert has_ended(child)


def test_a_process_that_ends_by_itself_leaves_no_child_behind():
    code, said, child, _ = interrupted(UNHANDLED)
    assert (code, said) == (130, ("", ""))
    assert has_ended(child)
