"""One deadline for a call, however many frames come that it does not wait for."""

from __future__ import annotations

import time
from collections.abc import Callable


class Deadline:
    """The end of a wait of timeout_s, which begins now."""

    def __init__(self, timeout_s: float, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._end_s = clock_s() + timeout_s

    @property
    def left_s(self) -> float:
        """Time left in s, 0 once it is over."""
        return max(0.0, self._end_s - self._clock_s())
