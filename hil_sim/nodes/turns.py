"""How a control period passes on the plant's side: in lock step, paced, or on the wall clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

from hil_sim.bus import CanBus, Frame
from hil_sim.clock import Clock

MOST_FRAMES = 10_000
"""Foreign frames after which an ECU that does not answer is taken for silent."""


class Turn(Protocol):
    """Gathers the frames that answer the measurements of a control period."""

    sync: bool
    """Whether the plant starts each period with a SYNC frame."""

    def time_s(self, period: int) -> float:
        """Time stamp of a frame that passes in a period."""
        ...

    def answers(self, bus: CanBus, period: int, last_id: int) -> Iterator[Frame]:
        """Frames of others in a period; one with last_id is the last of an ECU's step."""
        ...


class LockStep:
    """The plant waits for the ECU, and time is virtual.

    `serve` lets an ECU in the same thread answer. The timeout is a safety net for an ECU that
    does not: nothing else depends on the wall clock.
    """

    sync = True

    def __init__(
        self, period_s: float, timeout_s: float, serve: Callable[[], object] | None = None
    ) -> None:
        self._period_s = period_s
        self._timeout_s = timeout_s
        self._serve = serve

    def time_s(self, period: int) -> float:
        """The period's virtual start."""
        return period * self._period_s

    def answers(self, bus: CanBus, period: int, last_id: int) -> Iterator[Frame]:
        """Frames up to the ECU's last one."""
        if self._serve is not None:
            self._serve()
        for _ in range(MOST_FRAMES):
            frame = bus.receive(self._timeout_s)
            if frame is None:
                return
            yield frame
            if frame.frame_id == last_id:
                return


class PacedLockStep(LockStep):
    """Lock step in which a period does not end before its time on the wall clock."""

    def __init__(
        self, period_s: float, timeout_s: float, serve: Callable[[], object] | None, clock: Clock
    ) -> None:
        super().__init__(period_s, timeout_s, serve)
        self._clock = clock
        self._start_s = clock.now_s()

    def answers(self, bus: CanBus, period: int, last_id: int) -> Iterator[Frame]:
        """Frames up to the ECU's last one; then the rest of the period passes."""
        yield from super().answers(bus, period, last_id)
        self._clock.sleep_until_s(self._start_s + self.time_s(period + 1))


class OnClock:
    """Plant and ECU run on clocks of their own; there is no SYNC and nobody waits."""

    sync = False

    def __init__(self, period_s: float, clock: Clock) -> None:
        self._period_s = period_s
        self._clock = clock
        self._start_s = clock.now_s()

    def time_s(self, period: int) -> float:
        """Wall-clock time since the start."""
        return self._clock.now_s() - self._start_s

    def answers(self, bus: CanBus, period: int, last_id: int) -> Iterator[Frame]:
        """Every frame until the period is over."""
        due_s = self._start_s + (period + 1) * self._period_s
        while (left_s := due_s - self._clock.now_s()) > 0.0:
            frame = bus.receive(left_s)
            if frame is not None:
                yield frame
