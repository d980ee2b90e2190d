"""A board in QEMU: started, reached, switched off; what its serial line loses is counted."""

from __future__ import annotations

import re
import socket
from contextlib import suppress
from pathlib import Path

import pytest

from bms.errors import InputError
from hil_sim.targets import Emulation
from tests.firmware.damaged_images import BOARD
from tests.firmware.ports import built, needs_emulator

pytestmark = needs_emulator

OPEN, SYNC, FLAGS = b"S6\rO\r", b"t0800\r", b"F\r"
COMMAND = b"t1805"
COMMAND_LINE, FLAG_ANSWER = re.compile(rb"t1805\w{10}\r"), re.compile(rb"F0\d\r")
LOSSES = re.compile(rb"t7F08([0-9A-F]{8})([0-9A-F]{8})\r")
LINE_TIMEOUT_S = 10.0  # the machine may be busy


@pytest.fixture(scope="module")
def firmware() -> Path:
    return built("mps2_an386") / "firmware.bin"


def connected(board: Emulation) -> socket.socket:
    line = socket.create_connection(("127.0.0.1", board.port), LINE_TIMEOUT_S)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    line.sendall(OPEN)
    return line


def said_until(line: socket.socket, end: re.Pattern[bytes]) -> bytes:
    """Everything up to a pattern; TimeoutError when it does not come."""
    text = b""
    while not end.search(text):
        chunk = line.recv(1 << 16)
        assert chunk, f"the board has gone after {text[-100:]!r}"
        text += chunk
    return text


def lost(text: bytes) -> tuple[int, int]:
    """Lines and frames lost, as the last report says."""
    reports = LOSSES.findall(text) or [(b"", b"")]
    lines, frames = (int.from_bytes(bytes.fromhex(n.decode()), "little") for n in reports[-1])
    return lines, frames


def said(line: socket.socket) -> bytes:
    """Everything up to a silence."""
    line.settimeout(0.5)
    text = b""
    with suppress(TimeoutError):
        while chunk := line.recv(1 << 16):
            text += chunk
    line.settimeout(LINE_TIMEOUT_S)
    return text


def test_every_line_is_either_answered_or_counted_as_lost(firmware: Path) -> None:
    with Emulation(firmware, BOARD) as board, connected(board) as line:
        line.sendall(1500 * SYNC)  # 9 kB at once, of which 1 kB finds room
        sent, text = 1500, said(line)
        while text.count(COMMAND) + sum(lost(text)) < sent < 1520:
            line.sendall(SYNC)  # a loss is reported as soon as there is something to send
            sent += 1
            text += said(line)
        line.sendall(FLAGS)
        text += said_until(line, FLAG_ANSWER)
    lines_lost, frames_lost = lost(text)
    assert text.count(COMMAND) + lines_lost == sent and frames_lost == 0
    # How many are lost is up to the machine's load; test_slcan.py has the exact cases.
    assert text.endswith(b"F01\r" if lines_lost else b"F00\r")


def test_in_lock_step_nothing_is_lost(firmware: Path) -> None:
    with Emulation(firmware, BOARD) as board, connected(board) as line:
        for period in range(1, 201):
            line.sendall(SYNC)
            assert not LOSSES.search(said_until(line, COMMAND_LINE)), f"period {period}"
        line.sendall(FLAGS)
        assert said_until(line, FLAG_ANSWER) == b"F00\r"


def test_a_board_starts_anew_each_time(firmware: Path) -> None:
    answers = []
    for _ in range(2):
        with Emulation(firmware, BOARD) as board, connected(board) as line:
            line.sendall(SYNC)
            answers.append(said_until(line, COMMAND_LINE))
    assert answers[0] == answers[1]


def test_a_board_that_is_switched_off_is_gone(firmware: Path) -> None:
    with Emulation(firmware, BOARD) as board:
        assert board.is_running
    assert not board.is_running
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", board.port), 1.0)


def test_what_the_emulator_says_is_kept(firmware: Path, tmp_path: Path) -> None:
    log = tmp_path / "qemu.log"
    with Emulation(firmware, BOARD, log=log, options=("-no-such-option",)) as board:
        assert board.wait(LINE_TIMEOUT_S) not in (None, 0)
    assert "no-such-option" in log.read_text()


def test_an_unknown_board_is_told(firmware: Path) -> None:
    with pytest.raises(InputError, match="choose one of mps2-an385, mps2-an386"):
        Emulation(firmware, "mps2-an999")


def test_without_qemu_the_remedy_is_told(firmware: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match="apt-get install qemu-system-arm"):
        Emulation(firmware, BOARD)
