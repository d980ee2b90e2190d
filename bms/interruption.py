"""Ctrl-C ends every command in time, with its worker processes and without a word from them.

The first Ctrl-C is a KeyboardInterrupt, so that what is half done is cleaned up; further ones would
only disturb that, and are ignored. Whoever holds up the end is ended: child processes first, this
process at last.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread, current_thread, main_thread
from types import FrameType

EXIT_INTERRUPTED = 130
INTERRUPTED = "bms: interrupted"
CHILDREN_S = 0.6
"""After this time children are ended."""
LAST_S = 1.5
"""After this time the process ends, whatever it does."""


@contextmanager
def prompt_interrupts() -> Iterator[None]:
    """Let Ctrl-C end what runs in the `with` block, and its children, within LAST_S.

    Does nothing outside the main thread or where the caller handles or ignores Ctrl-C himself.
    """
    is_default = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not is_default or current_thread() is not main_thread():
        yield
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    watch = _Watch(reader)
    signal.signal(signal.SIGINT, watch.interrupt)
    # Written to at once, even while the main thread is in a long call of C.
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    watch.start()
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGINT) == watch.interrupt:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        if watch.is_interrupted:
            _end(_children(), signal.SIGTERM)
        else:
            signal.set_wakeup_fd(before)
            os.close(writer)
            watch.join()


class _Watch(Thread):
    """Sees to it that an interrupted process ends."""

    def __init__(self, reader: int) -> None:
        super().__init__(daemon=True)
        self._reader = reader
        self._owner = os.getpid()
        self.is_interrupted = False

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Handler of SIGINT."""
        if os.getpid() != self._owner:  # a copy of the process that works for it
            os._exit(EXIT_INTERRUPTED)
        self.is_interrupted = True
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        raise KeyboardInterrupt

    def run(self) -> None:
        """Wait for an interrupt, and then until it is time."""
        while True:
            told = os.read(self._reader, 1)
            if not told:
                os.close(self._reader)
                return
            # A command that has a handler of its own, such as `bms ecu`, ends in its own way.
            handler = signal.getsignal(signal.SIGINT)
            if told[0] == signal.SIGINT and handler in (self.interrupt, signal.SIG_IGN):
                break
        self.is_interrupted = True
        time.sleep(CHILDREN_S)
        _end(_children(), signal.SIGTERM)
        time.sleep(LAST_S - CHILDREN_S)
        _end(_children(), signal.SIGKILL)
        os.write(2, f"{INTERRUPTED}\n".encode())
        os._exit(EXIT_INTERRUPTED)


def _children() -> list[int]:
    """Process ids of the children of all threads."""
    found: list[int] = []
    for listing in Path("/proc/self/task").glob("*/children"):
        with suppress(OSError):  # the thread has ended meanwhile
            found += map(int, listing.read_text(encoding="ascii").split())
    return found


def _end(children: list[int], number: signal.Signals) -> None:
    for child in children:
        with suppress(ProcessLookupError):
            os.kill(child, number)
