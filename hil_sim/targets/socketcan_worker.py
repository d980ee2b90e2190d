"""A process that plays recorded frames to a native ECU on a SocketCAN interface; see linux.py.

    python socketcan_worker.py PROGRAM INTERFACE FRAMES ANSWERS LAST_ID

FRAMES is JSON: for each recording, for each control period, the frames [identifier, data] that the
ECU gets, SYNC the last. ANSWERS becomes the same with what the ECU says. A program is started anew
for each recording. Uses nothing but the standard library, since imports are slow in the guest.
"""

from __future__ import annotations

import json
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

_FRAME = struct.Struct("=IB3x8s")
_RECEIVE_BUFFER_BYTES = 1 << 20
_ANSWER_S = 10.0
_SILENCE_S = "60"
_STARTS = 10
"""Before the first SYNC an ECU keeps its own clock, and on a busy machine it may have stepped by it
before that came: then it was not in lock step, and is started anew."""


def main() -> None:
    """Run the process; exit code 1 with a line on stderr when an ECU does not end well."""
    program, interface, frames, answers, last_id = sys.argv[1:]
    bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
    _set_timeout(bus, _ANSWER_S)
    bus.bind((interface,))
    recordings = json.loads(Path(frames).read_text(encoding="utf-8"))
    said = [_play([program, interface], bus, recording, int(last_id)) for recording in recordings]
    Path(answers).write_text(json.dumps(said), encoding="utf-8")


def _play(
    command: list[str],
    bus: socket.socket,
    recording: list[list[tuple[int, str]]],
    last_id: int,
) -> list[list[tuple[int, str]]]:
    """Answers of an ECU that has stepped once for each period."""
    for _ in range(_STARTS):
        answers, steps = _played(command, bus, recording, last_id)
        if steps == len(recording):
            return answers
        _forget(bus)
    sys.exit(f"{command[0]}: {steps} steps in {len(recording)} periods, {_STARTS} times in a row")


def _played(
    command: list[str],
    bus: socket.socket,
    recording: list[list[tuple[int, str]]],
    last_id: int,
) -> tuple[list[list[tuple[int, str]]], int]:
    """Answers of one ECU, and how many steps it says it made."""
    with subprocess.Popen(
        [*command, "--silence-s", _SILENCE_S], stdout=subprocess.PIPE, text=True
    ) as ecu:
        try:
            assert ecu.stdout is not None
            if "listening" not in ecu.stdout.readline():
                sys.exit(f"{command[0]}: does not say that it listens")
            answers = [_answer(bus, period, last_id) for period in recording]
        finally:
            ecu.send_signal(signal.SIGTERM)
        said = ecu.communicate()[0]
    steps = re.search(r"(\d+) steps", said)
    if ecu.returncode or steps is None:
        sys.exit(f"{command[0]}: exit code {ecu.returncode}: {said.strip()}")
    return answers, int(steps[1])


def _forget(bus: socket.socket) -> None:
    """Leave nothing of one ECU for the next one's answers."""
    with suppress(BlockingIOError):
        while True:
            bus.recv(_FRAME.size, socket.MSG_DONTWAIT)


def _set_timeout(bus: socket.socket, timeout_s: float) -> None:
    """As bus.settimeout, which costs a second system call for each frame, dear in the guest."""
    seconds = int(timeout_s)
    timeval = struct.pack("ll", seconds, int(1e6 * (timeout_s - seconds)))
    bus.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, timeval)


def _answer(
    bus: socket.socket, period: list[tuple[int, str]], last_id: int
) -> list[tuple[int, str]]:
    for frame_id, data in period:
        content = bytes.fromhex(data)
        bus.send(_FRAME.pack(frame_id, len(content), content))
    answer: list[tuple[int, str]] = []
    end_s = time.monotonic() + _ANSWER_S
    while time.monotonic() < end_s:
        try:
            frame_id, length, content = _FRAME.unpack(bus.recv(_FRAME.size))
        except BlockingIOError:
            break
        answer.append((frame_id, content[:length].hex()))
        if frame_id == last_id:
            return answer
    sys.exit(f"no answer in {_ANSWER_S:g} s")


if __name__ == "__main__":
    main()
