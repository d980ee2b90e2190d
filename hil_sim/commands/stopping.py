"""The end of a command that runs until SIGTERM or Ctrl-C."""

from __future__ import annotations

import signal
from threading import Event


def stop_event() -> Event:
    """An event that SIGTERM and Ctrl-C set from now on, instead of ending the process."""
    stop = Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    return stop
