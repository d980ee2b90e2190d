"""The firmware as a process of Linux on a SocketCAN interface, in the guest where there is none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from bms.errors import BusError, InputError
from hil_sim.bus.buses import GUEST, Frame
from hil_sim.replay.recording import LAST_MESSAGE, Answer, Recording

WORKER = Path(__file__).with_name("socketcan_worker.py")
INTERFACE = "vcan0"
KERNEL = "/usr/bin/linux.uml"
"""Of the guest, as in hil_sim/bus/vcan_guest.sh."""
_LONGEST_START_S = 120.0
_LONGEST_PERIOD_S = 0.02
"""Ten times what a control period takes in the guest on an idle machine."""


def require_interface() -> None:
    """Raise InputError where there is neither vcan0 nor what its guest needs."""
    if Path("/sys/class/net", INTERFACE).exists():
        return
    if not Path(KERNEL).exists():
        raise InputError(
            f"{INTERFACE}: no such interface, and no guest that has one; run "
            "'apt-get install -y --no-install-recommends user-mode-linux'"
        )


def replay_on_linux(program: Path, recordings: Sequence[Recording]) -> list[list[Answer]]:
    """What a native ECU answers to the frames of recordings in lock step, started anew for each.

    Raises InputError without vcan0 and guest, BusError when the ECU does not end well.
    """
    require_interface()
    frames = [
        [[(frame.frame_id, frame.data.hex()) for frame in period.received] for period in r.periods]
        for r in recordings
    ]
    last_id = recordings[0].database[LAST_MESSAGE].frame_id
    with TemporaryDirectory() as folder:
        asked, said = Path(folder) / "frames.json", Path(folder) / "answers.json"
        asked.write_text(json.dumps(frames), encoding="utf-8")
        worker = [sys.executable, "-S", str(WORKER), str(program.resolve()), INTERFACE]
        command = ["bash", str(GUEST), *worker, str(asked), str(said), str(last_id)]
        limit_s = _LONGEST_START_S + _LONGEST_PERIOD_S * sum(map(len, frames))
        environment = {"VCAN_TIMEOUT_S": f"{limit_s:.0f}", **os.environ}
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        if done.returncode or not said.is_file():
            reason = (done.stderr.splitlines() or [f"exit code {done.returncode}"])[-1]
            raise BusError(f"target 'linux': {reason}")
        answers = json.loads(said.read_text(encoding="utf-8"))
    return [
        [tuple(Frame(frame_id, bytes.fromhex(data)) for frame_id, data in period) for period in log]
        for log in answers
    ]
