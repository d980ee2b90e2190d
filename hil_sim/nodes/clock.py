"""The wall clock, passed to whatever runs in real time."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Seconds that never run backwards."""

    def now_s(self) -> float:
        """Present time in s from any origin."""
        ...

    def sleep_until_s(self, time_s: float) -> None:
        """Return at that time, or at once when it has passed."""


class WallClock:
    """The machine's monotonic clock."""

    def now_s(self) -> float:
        """Present time in s."""
        return time.monotonic()

    def sleep_until_s(self, time_s: float) -> None:
        """Sleep until that time."""
        time.sleep(max(0.0, time_s - time.monotonic()))
