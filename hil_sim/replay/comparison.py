"""What two ECUs made of the same frames, held against each other decision by decision."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from hil_sim.bus.buses import Frame
from hil_sim.bus.database import Values
from hil_sim.replay.recording import Answer, Period, Recording
from hil_sim.replay.signals import Signals


@dataclass
class SignalDifference:
    """How one signal differed over all periods, in its unit.

    `largest` is None for names and bits, and when it was never available on both sides.
    """

    signal: str
    periods: int = 0
    largest: float | None = None

    def note(self, one: float | None, other: float | None) -> None:
        """Count one period."""
        self.periods += 1
        if one is not None and other is not None:
            self.largest = max(self.largest or 0.0, abs(one - other))


@dataclass(frozen=True)
class PeriodDifference:
    """One period in which two sides differ: what both got, and what each said."""

    period: int
    time_s: float
    received: Values
    sides: tuple[Values, Values]
    signals: tuple[str, ...]


@dataclass
class Comparison:
    """All differences of two sides."""

    periods: int
    differing_periods: int = 0
    first: PeriodDifference | None = None
    signals: dict[str, SignalDifference] = field(default_factory=dict)

    @property
    def is_equal(self) -> bool:
        """Whether both sides said the same in every period."""
        return self.differing_periods == 0


def compare(
    recording: Recording,
    signals: Signals,
    one: Sequence[Answer],
    other: Sequence[Answer],
    ignored_ids: Collection[int] = (),
) -> Comparison:
    """Compare two lists of answers to a recording; frames with an ignored identifier do not count.

    Frames are equal when all their bytes are. What no value of a signal explains is listed as
    'counter or CRC of' or 'number of' a message, or as 'order of messages'. Raises ValueError when
    a list is not as long as the recording.
    """
    result = Comparison(len(recording.periods))
    rows = zip(recording.periods, one, other, strict=True)
    for number, (period, *answers) in enumerate(rows):
        left, right = (_without(answer, ignored_ids) for answer in answers)
        if left != right:
            _note(result, number, period, signals, left, right)
    return result


def _without(answer: Answer, ignored_ids: Collection[int]) -> Answer:
    return tuple(frame for frame in answer if frame.frame_id not in ignored_ids)


def _note(
    result: Comparison, number: int, period: Period, signals: Signals, left: Answer, right: Answer
) -> None:
    names = []
    for frame_id in dict.fromkeys(frame.frame_id for frame in (*left, *right)):
        one, other = _of(left, frame_id), _of(right, frame_id)
        if one == other:
            continue
        values = signals.decode(one), signals.decode(other)
        found = [name for name in {**values[0], **values[1]} if _differs(name, *values)]
        if len(one) != len(other) and one and other:
            found.append(f"number of {signals.message(frame_id)}")
        for name in found or [f"counter or CRC of {signals.message(frame_id)}"]:
            names.append(name)
            difference = result.signals.setdefault(name, SignalDifference(name))
            is_quantity = signals.is_quantity(name)
            difference.note(*(side.get(name) if is_quantity else None for side in values))
    if not names:
        names = ["order of messages"]
        result.signals.setdefault(names[0], SignalDifference(names[0])).note(None, None)
    result.differing_periods += 1
    if result.first is None:
        received = signals.decode(Frame(frame.frame_id, frame.data) for frame in period.received)
        sides = signals.decode(left), signals.decode(right)
        result.first = PeriodDifference(number, period.time_s, received, sides, tuple(names))


def _of(answer: Answer, frame_id: int) -> list[Frame]:
    return [frame for frame in answer if frame.frame_id == frame_id]


def _differs(name: str, one: Values, other: Values) -> bool:
    return (name in one) != (name in other) or one.get(name) != other.get(name)
