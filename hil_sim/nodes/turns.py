"""How a control period passes on the plant's side: in lock step, paced, or on the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from hil_sim.bus.buses import CanBus, Frame
from hil_sim.bus.catalog import FrameId
from hil_sim.nodes.clock import Clock
from hil_sim.nodes.punctuality import PlantWatch

MOST_FRAMES = 10_000
"""Foreign frames after which an ECU that does not answer is taken for silent."""
WORK_PERIODS = 0.1
"""End of a real-time period in which the plant does not listen but integrates the cell."""

StampedFrame = tuple[float, Frame]
"""A frame with its time in s."""
IsLast = Callable[[Frame], bool]
_COMMAND_ID = int(FrameId.CHARGE_COMMAND)
"""What an ECU's step ends with."""


class Turn(Protocol):
    """Gathers the frames that answer the measurements of a control period."""

    sync: bool
    """Whether the plant starts each period with a SYNC frame."""

    @property
    def watch(self) -> PlantWatch | None:
        """How punctual the run is; None where time is virtual."""
        ...

    def wait(self) -> None:
        """Return when the next period is due."""
        ...

    def begin(self) -> None:
        """The measurements of the next period go out now."""
        ...

    def time_s(self, period: int) -> float:
        """Time stamp of a frame that passes in a period."""
        ...

    def answers(self, bus: CanBus, period: int, is_last: IsLast) -> list[StampedFrame]:
        """Frames of others in a period; is_last tells the charge command of an ECU's step."""
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

    @property
    def watch(self) -> PlantWatch | None:
        """None, because nothing is measured in virtual time."""
        return None

    def wait(self) -> None:
        """Return at once: a period is due when the one before is over."""

    def begin(self) -> None:
        """Do nothing: in virtual time every period begins when it is due."""

    def time_s(self, period: int) -> float:
        """Virtual start of the period, in s since the start of the run."""
        return period * self._period_s

    def answers(self, bus: CanBus, period: int, is_last: IsLast) -> list[StampedFrame]:
        """Frames up to the last one of the ECU's step, or until it has been silent too long."""
        if self._serve is not None:
            self._serve()
        frames = bus.gather(_COMMAND_ID, is_last, self._timeout_s, MOST_FRAMES)
        time_s = self.time_s(period)
        return [(time_s, frame) for frame in frames]


class _OnTime:
    """Periods that begin by the wall clock, and how punctual they are."""

    def __init__(self, period_s: float, clock: Clock) -> None:
        self._clock = clock
        self._watch = PlantWatch(period_s)

    @property
    def watch(self) -> PlantWatch:
        """When measurements went out and answers came so far."""
        return self._watch

    def wait(self) -> None:
        """Sleep until the next period is due."""
        self._watch.wait(self._clock)

    def begin(self) -> None:
        """Note that the measurements of the next period go out now."""
        self._watch.begin(self._clock.now_s())


class PacedLockStep(_OnTime, LockStep):
    """Lock step in which no period begins before its time on the wall clock."""

    def __init__(
        self, period_s: float, timeout_s: float, serve: Callable[[], object] | None, clock: Clock
    ) -> None:
        _OnTime.__init__(self, period_s, clock)
        LockStep.__init__(self, period_s, timeout_s, serve)

    def answers(self, bus: CanBus, period: int, is_last: IsLast) -> list[StampedFrame]:
        """The frames of lock step; notes when the last one of the ECU's step came."""

        def noted(frame: Frame) -> bool:
            ends = is_last(frame)
            if ends:
                self._watch.answered(self._clock.now_s())
            return ends

        return super().answers(bus, period, noted)


class OnClock(_OnTime):
    """Plant and ECU run on clocks of their own; there is no SYNC and nobody waits."""

    sync = False

    def __init__(self, period_s: float, clock: Clock) -> None:
        super().__init__(period_s, clock)
        self._work_s = WORK_PERIODS * period_s

    def time_s(self, period: int) -> float:
        """Wall-clock time since the first period began."""
        return self._clock.now_s() - self._watch.slots.start_s

    def answers(self, bus: CanBus, period: int, is_last: IsLast) -> list[StampedFrame]:
        """Every frame until the plant's own work for the next period has to begin."""
        heard = list[StampedFrame]()
        end_s = self._watch.slots.due_s - self._work_s
        while (left_s := end_s - self._clock.now_s()) > 0.0:
            frame = bus.receive(left_s)
            if frame is not None:
                if is_last(frame):
                    self._watch.answered(self._clock.now_s())
                heard.append((self.time_s(period), frame))
        return heard
