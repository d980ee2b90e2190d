"""`bms monitor` on a pseudo-terminal."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time

import pyte

COMMAND = [sys.executable, "-c", "from bms.cli import main; main()", "monitor"]
PATIENCE_S = 30.0


class Terminal:
    """A command on a pseudo-terminal of 80 by 24, and what that displays."""

    def __init__(self, *arguments: str) -> None:
        self._near, self._far = pty.openpty()
        fcntl.ioctl(self._far, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.settings = termios.tcgetattr(self._far)
        self._screen = pyte.Screen(80, 24)
        self._stream = pyte.ByteStream(self._screen)
        self.process = subprocess.Popen(
            [*COMMAND, *arguments],
            stdin=self._far,
            stdout=self._far,
            stderr=self._far,
            env={**os.environ, "TERM": "xterm-256color"},
            start_new_session=True,
        )

    def wait_for(self, *patterns: str) -> str:
        """The display, once it holds all of the patterns; fails after a while."""
        end_s = time.monotonic() + PATIENCE_S
        while not all(re.search(pattern, self.display) for pattern in patterns):
            assert time.monotonic() < end_s, f"{patterns} not on:\n{self.display}"
            if select.select([self._near], [], [], 0.1)[0]:
                self._stream.feed(os.read(self._near, 65536))
        return self.display

    @property
    def display(self) -> str:
        return "\n".join(self._screen.display)

    def press(self, key: bytes) -> None:
        os.write(self._near, key)

    def current_settings(self) -> list:
        return termios.tcgetattr(self._far)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self._near)
        os.close(self._far)
