"""The wall clock, passed to whatever runs in real time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A source of time in s that never runs backwards, and a way to wait for a time."""

    def now_s(self) -> float:
        """Present time in s from any origin."""
        ...

    def sleep_until_s(self, time_s: float) -> None:
        """Return at that time, or at once when it has passed."""


class WallClock:
    """The machine's monotonic clock, for runs in real time."""

    def now_s(self) -> float:
        """Present time in s on that clock."""
        return time.monotonic()

    def sleep_until_s(self, time_s: float) -> None:
        """Let the thread sleep until that time; return at once when it has passed."""
        time.sleep(max(0.0, time_s - time.monotonic()))
