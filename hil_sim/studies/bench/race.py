"""Times several ways to the same answers, after their answers have been compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from bms.arrays import Array, IntArray
from bms.errors import BmsError

ClockNs = Callable[[], int]
"""Nanoseconds since any moment; it must not run backwards."""


Rows = IntArray


@dataclass(frozen=True)
class Clocks:
    """The wall clock, and the time that this process has had a processor."""

    wall_ns: ClockNs
    cpu_ns: ClockNs


class WrongAnswerError(BmsError):
    """A peer that does not compute what it is timed for."""


@dataclass(frozen=True)
class Peer:
    """One way to the answers.

    `solve` returns its answers (n,) to the problems `rows` of the common list, or to all of them;
    `package` names what does the work, with its version.
    """

    name: str
    package: str
    solve: Callable[[], Array]
    tolerance: float
    """How far an answer may be from the reference, in the unit of the answers."""
    rows: Rows | None = None


@dataclass(frozen=True)
class Absent:
    """A peer that cannot run here, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class Quartiles:
    """Median and quartiles of repeated measurements, and their number."""

    median: float
    low: float
    high: float
    repetitions: int

    @classmethod
    def of(cls, values: Sequence[float]) -> Quartiles:
        """Quartiles of at least one value."""
        low, high = np.quantile(values, (0.25, 0.75)).tolist()
        return cls(median(values), low, high, len(values))


@dataclass(frozen=True)
class Timed:
    """Time per answer in ns, and of how many answers each repetition consisted."""

    name: str
    package: str
    time_ns: Quartiles
    answers: int
    largest_difference: float
    """From the reference, in the unit of the answers."""


def race(
    reference: Array, peers: Sequence[Peer | Absent], repetitions: int, clock_ns: ClockNs
) -> list[Timed | Absent]:
    """Every present peer's time per answer; WrongAnswerError when one is not within its tolerance.

    The answers are compared in a first, untimed call, which fills the caches too. The clock is to
    be that of the processor's time: on a busy machine the wall clock would be kind to short runs.
    """
    return [
        peer if isinstance(peer, Absent) else _timed(reference, peer, repetitions, clock_ns)
        for peer in peers
    ]


def _timed(reference: Array, peer: Peer, repetitions: int, clock_ns: ClockNs) -> Timed:
    answers = peer.solve()
    right = reference if peer.rows is None else reference[peer.rows]
    difference = np.abs(answers - right)
    worst = int(np.argmax(np.where(np.isnan(difference), np.inf, difference)))
    if not difference[worst] <= peer.tolerance:
        raise WrongAnswerError(
            f"{peer.name}: answers {answers[worst]:g} where {right[worst]:g} is right "
            f"(allowed difference {peer.tolerance:g}); it is not timed"
        )
    runs = []
    for _ in range(repetitions):
        begin_ns = clock_ns()
        peer.solve()
        runs.append((clock_ns() - begin_ns) / len(answers))
    return Timed(
        peer.name, peer.package, Quartiles.of(runs), len(answers), float(difference[worst])
    )
