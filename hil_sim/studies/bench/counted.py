"""Instructions of a control period on this machine by function, counted by Callgrind."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from bms.errors import InputError
from bms.firmware import _firmware
from bms.firmware.calibration import calibration_bytes
from hil_sim.studies.bench.problem import Problem

_VALGRIND = "valgrind"
_PROGRAM = Path(__file__).with_name("played.py")
_PERIOD = ("bms_receive", "bms_step", "bms_transmit")
"""What a control period calls of the firmware; the loop around it is not counted."""
_FRAME_FIELDS = np.dtype([("id", "<u4"), ("length", "u1"), ("data", "u1", 8), ("", "V3")])
_NAME = re.compile(r"fn=\((\d+)\)(?: (.*))?")


def instructions_of_period(problem: Problem) -> dict[str, float]:
    """Mean instructions of each of the firmware's functions over the charge, a period, most first.

    What the compiler took into a caller counts there. InputError where Callgrind is missing or has
    not played the charge.
    """
    if shutil.which(_VALGRIND) is None:
        raise InputError(f"{_VALGRIND}: not found; install it (Debian: apt-get install valgrind)")
    firmware, frames = problem.firmware, problem.frames
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = {part: folder / part for part in ("calibration", "frames", "counts")}
        files["calibration"].write_bytes(_whole_block(firmware.preset, firmware.model))
        files["frames"].write_bytes(_frame_bytes(frame for period in frames for frame in period))
        played = [
            _firmware.__file__,
            files["calibration"],
            _firmware.ffi.sizeof("bms_t"),
            files["frames"],
            len(frames[0]),
        ]
        counting = ["--tool=callgrind", *(f"--toggle-collect={name}" for name in _PERIOD)]
        done = subprocess.run(
            [
                _VALGRIND,
                *counting,
                f"--callgrind-out-file={files['counts']}",
                *(sys.executable, "-I", "-S", str(_PROGRAM)),
                *map(str, played),
            ],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0 or not done.stdout.startswith(f"{len(frames)} "):
            said = (done.stderr.strip().splitlines() or ["said nothing"])[-1]
            raise InputError(f"{_VALGRIND}: has not played the charge ({said})")
        with files["counts"].open(encoding="utf-8") as lines:
            counts = Counter[str]()
            for function, count in own_costs(lines):
                counts[function] += count
    return {function: count / len(frames) for function, count in counts.most_common() if count}


def own_costs(lines: Iterable[str]) -> Iterator[tuple[str, int]]:
    """Function and own cost of each line of a Callgrind file that has one.

    What a called function cost stands on the line behind `calls=` and is left out.
    """
    names: dict[str, str] = {}
    function, is_call = "", False
    for line in lines:
        if found := _NAME.match(line.removeprefix("c")):
            if found[2]:
                names[found[1]] = found[2]
            if line.startswith("fn="):
                function = names[found[1]]
        elif line.startswith("calls="):
            is_call = True
        elif line[:1] in "0123456789+-*" and line.strip():
            if not is_call:
                yield function, int(line.split()[1])
            is_call = False


def _whole_block(preset: object, model: object) -> bytes:
    """The calibration with the room that a whole structure has."""
    block = calibration_bytes(preset, model)  # type: ignore[arg-type]
    return block.ljust(_firmware.ffi.sizeof("bms_calibration_t"), b"\0")


def _frame_bytes(frames: Iterable[tuple[int, bytes]]) -> bytes:
    rows = [(i, len(data), list(data.ljust(8, b"\0"))) for i, data in frames]
    return np.array([(*row, b"") for row in rows], dtype=_FRAME_FIELDS).tobytes()
