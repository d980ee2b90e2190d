"""QEMU's monitor: what happens to a board, and what is in its memory."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

START_TIMEOUT_S, ANSWER_TIMEOUT_S = 20.0, 20.0


def monitor_options(path: Path) -> tuple[str, ...]:
    """Options of QEMU for a monitor at this socket."""
    return "-qmp", f"unix:{path},server=on,wait=off"


class Monitor:
    """A connection that has been greeted."""

    def __init__(self, line: socket.socket) -> None:
        self._file = line.makefile("rw")
        self.execute("qmp_capabilities")

    def execute(self, command: str, **arguments: Any) -> None:
        self._file.write(json.dumps({"execute": command, "arguments": arguments}) + "\n")
        self._file.flush()
        assert any("return" in message for message in self._messages())

    def await_event(self, name: str) -> None:
        """TimeoutError when it does not come."""
        assert any(message.get("event") == name for message in self._messages())

    def _messages(self) -> Iterator[dict[str, Any]]:
        return (json.loads(line) for line in self._file)


@contextmanager
def monitor(path: Path) -> Iterator[Monitor]:
    """Connect as soon as the emulator has opened the socket."""
    end_s = time.monotonic() + START_TIMEOUT_S
    while not path.exists() and time.monotonic() < end_s:
        time.sleep(0.01)
    with socket.socket(socket.AF_UNIX) as line:
        line.settimeout(ANSWER_TIMEOUT_S)
        line.connect(str(path))
        yield Monitor(line)
