"""The key q, read without echo and without Enter where standard input is a terminal."""

from __future__ import annotations

import os
import select
import sys
from typing import Any

from hil_sim.bus.closing import Closing

try:
    import termios
    import tty
except ImportError:  # Windows; Ctrl-C ends the monitor there.
    termios = None  # type: ignore[assignment]


class Keyboard(Closing):
    """Puts the terminal back as it was at the end."""

    def __init__(self) -> None:
        self._saved: list[Any] | None = None
        if termios is not None and sys.stdin.isatty():
            self._saved = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)

    def close(self) -> None:
        """Give the terminal back the settings that it had."""
        if self._saved is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._saved)

    def wants_to_quit(self) -> bool:
        """Whether q was pressed since the last call, or the terminal is gone."""
        if self._saved is None or not select.select([sys.stdin], [], [], 0.0)[0]:
            return False
        keys = os.read(sys.stdin.fileno(), 1024)
        return not keys or b"q" in keys.lower()
