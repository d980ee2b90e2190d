"""How punctual a real-time run is: slots of time, their deadlines, and figures of both sides.

A party's slot k is due at start + k periods. Its deadline is half a period after that, because
the ECU steps midway between two measurements: what begins later is too late for the other side's
turn. A deadline is missed by a slot that begins at or after its deadline, and by one that is
skipped. So work that is resumed x periods after it was due misses round(x) deadlines, half a
period counting as a whole one, whether the party makes up for the slots or skips them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil_sim.nodes.clock import Clock

_MS_PER_S = 1000.0
DEADLINE_PERIODS = 0.5


class Slots:
    """The slots of one party: when the next is due, and how late the past ones began.

    Times in s on the clock of the caller.
    """

    def __init__(self, period_s: float, start_s: float) -> None:
        self.period_s = period_s
        self.start_s = start_s
        self.late_s: list[float] = []
        """For each slot that was not skipped, when it began less when it was due."""
        self.skipped = 0
        self.longest_stall_s = 0.0
        """How far behind its slots a party was at most that skips some."""

    @property
    def due_s(self) -> float:
        """When the next slot is due."""
        return self.start_s + (len(self.late_s) + self.skipped) * self.period_s

    def begin(self, now_s: float) -> None:
        """Note that the next slot begins at a time in s."""
        self.late_s.append(now_s - self.due_s)

    def skip_past(self, now_s: float) -> None:
        """Skip the slots that are over, so that a party goes on with the one that it is in."""
        self.longest_stall_s = max(self.longest_stall_s, now_s - self.due_s)
        self.skipped += max(0, math.floor((now_s - self.due_s) / self.period_s))

    @property
    def deadline_s(self) -> float:
        """Lateness in s from which on a slot counts as missed."""
        return DEADLINE_PERIODS * self.period_s

    @property
    def missed(self) -> int:
        """Number of deadlines missed, by slots that began late and by those skipped."""
        return self.skipped + sum(late_s >= self.deadline_s for late_s in self.late_s)


@dataclass(frozen=True)
class TimeStatistics:
    """Figures of many times, in ms.

    The jitter is their standard deviation; the 99 % quantile p99 is one of the times.
    """

    median_ms: float
    p99_ms: float
    max_ms: float
    jitter_ms: float

    @classmethod
    def of(cls, times_s: Sequence[float]) -> TimeStatistics | None:
        """Figures of times in s; None when there are none."""
        if not times_s:
            return None
        times_ms = np.asarray(times_s) * _MS_PER_S
        return cls(
            float(np.median(times_ms)),
            float(np.quantile(times_ms, 0.99, method="inverted_cdf")),
            float(times_ms.max()),
            float(times_ms.std()),
        )

    def __str__(self) -> str:
        return (
            f"median {self.median_ms:.2f} ms, p99 {self.p99_ms:.2f} ms, max {self.max_ms:.2f} ms, "
            f"jitter {self.jitter_ms:.2f} ms"
        )


@dataclass(frozen=True)
class Timing:
    """A real-time run as the plant saw it.

    `lateness` is when measurements went out less when they were due. `answer_latency` is from then
    to the ECU's charge command, for the periods in which one came; an ECU on its own clock steps
    half a period after the measurements. Periods count as without a command when none came that
    was new and intact, from the first command of the run on.
    """

    period_ms: float
    deadline_ms: float
    periods: int
    missed_deadlines: int
    lateness: TimeStatistics | None
    answer_latency: TimeStatistics | None
    periods_without_command: int
    longest_without_command_periods: int


class PlantWatch:
    """Notes when measurements went out and answers came; every period has its slot."""

    def __init__(self, period_s: float) -> None:
        self.slots = Slots(period_s, 0.0)
        self.latency_s: list[float] = []
        self._begun_s = 0.0
        self._is_answered = False

    def wait(self, clock: Clock) -> None:
        """Sleep until the next period is due; the first one is at any time."""
        if self.slots.late_s:
            clock.sleep_until_s(self.slots.due_s)

    def begin(self, now_s: float) -> None:
        """The measurements of the next period go out now; the first period sets the phase."""
        if not self.slots.late_s:
            self.slots.start_s = now_s
        self.slots.begin(now_s)
        self._begun_s, self._is_answered = now_s, False

    def answered(self, now_s: float) -> None:
        """A charge command has come; of several in a period the first counts."""
        if not self._is_answered:
            self.latency_s.append(now_s - self._begun_s)
            self._is_answered = True

    def timing(self, is_commanded: Sequence[bool]) -> Timing:
        """Figures, with whether there was a new, intact command in each period."""
        slots, silences = self.slots, _silences(is_commanded)
        return Timing(
            period_ms=slots.period_s * _MS_PER_S,
            deadline_ms=slots.deadline_s * _MS_PER_S,
            periods=len(slots.late_s),
            missed_deadlines=slots.missed,
            lateness=TimeStatistics.of(slots.late_s),
            answer_latency=TimeStatistics.of(self.latency_s),
            periods_without_command=sum(silences),
            longest_without_command_periods=max(silences, default=0),
        )


def _silences(is_commanded: Sequence[bool]) -> list[int]:
    """Lengths in periods of the gaps after the first command."""
    gaps, gap = [], 0
    first = next((n for n, commanded in enumerate(is_commanded) if commanded), len(is_commanded))
    for commanded in is_commanded[first:]:
        if commanded:
            gaps.append(gap)
            gap = 0
        else:
            gap += 1
    return [length for length in [*gaps, gap] if length]
