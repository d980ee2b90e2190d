"""How a command that runs until it is told to stop hears of that."""

from __future__ import annotations

import signal
from threading import Event


def stop_event() -> Event:
    """Set by SIGTERM and Ctrl-C from now on, in place of an end of the process."""
    stop = Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    return stop
