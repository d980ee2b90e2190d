"""What passes on the bus: how often each message comes, how old it is, how much is foreign."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

from hil_sim.bus.buses import Frame
from hil_sim.bus.database import MessageCodec, Values
from hil_sim.bus.foreign import ForeignFrame

RATE_WINDOW_S = 3.0
STALE_CYCLES = 3.0
"""Cycles of a message after which its last frame no longer tells how things are."""


class Rate:
    """Frames a second over the last RATE_WINDOW_S."""

    def __init__(self) -> None:
        self._times_s: deque[float] = deque()

    def add(self, time_s: float) -> None:
        """Count a frame at a time that does not run backwards."""
        self._times_s.append(time_s)
        self._forget(time_s)

    def per_s(self, now_s: float) -> float:
        """Mean rate between the first and the last frame of the window; 0 for fewer than two."""
        self._forget(now_s)
        if len(self._times_s) < 2:
            return 0.0
        span_s = self._times_s[-1] - self._times_s[0]
        return (len(self._times_s) - 1) / span_s if span_s > 0.0 else 0.0

    def _forget(self, now_s: float) -> None:
        while self._times_s and now_s - self._times_s[0] > RATE_WINDOW_S:
            self._times_s.popleft()


@dataclass(frozen=True)
class MessageTraffic:
    """How one message of the database fared; the age is that of the last good frame, in s."""

    frame_id: int
    name: str
    rate_per_s: float
    age_s: float | None
    is_stale: bool
    refused: int
    """Frames of wrong length or CRC."""


@dataclass(frozen=True)
class ForeignTraffic:
    """Frames that no message of the database has."""

    frames: int
    rate_per_s: float
    identifiers: int
    """Different 11-bit identifiers among them."""
    kinds: tuple[tuple[ForeignFrame, int], ...]
    """Those that are not 11-bit data frames, by kind."""


class MessageMeter:
    """Checks and counts the frames of one message and keeps the values of the last good one."""

    def __init__(self, codec: MessageCodec, cycle_s: float) -> None:
        self.codec = codec
        self.stale_s = STALE_CYCLES * cycle_s
        self.values: Values = {}
        self._rate = Rate()
        self._last_s: float | None = None
        self._refused = 0

    def take(self, time_s: float, data: bytes) -> Values | None:
        """Values of a frame, or None when it is refused."""
        self._rate.add(time_s)
        values = self.codec.decode(data)
        if values is None:
            self._refused += 1
            return None
        self.values = values
        self._last_s = time_s
        return values

    def traffic(self, now_s: float) -> MessageTraffic:
        """State of the message at a time in s."""
        age_s = None if self._last_s is None else now_s - self._last_s
        return MessageTraffic(
            frame_id=self.codec.frame_id,
            name=self.codec.name,
            rate_per_s=self._rate.per_s(now_s),
            age_s=age_s,
            is_stale=age_s is not None and age_s > self.stale_s,
            refused=self._refused,
        )


@dataclass
class ForeignMeter:
    """Counts frames that no message of the database has, by kind and identifier."""

    _rate: Rate = field(default_factory=Rate)
    _identifiers: set[int] = field(default_factory=set)
    _kinds: Counter[ForeignFrame] = field(default_factory=Counter)
    _frames: int = 0

    def take(self, time_s: float, frame: Frame | ForeignFrame) -> None:
        """Count a foreign frame that came at a time in s."""
        self._rate.add(time_s)
        self._frames += 1
        if isinstance(frame, ForeignFrame):
            self._kinds[frame] += 1
        else:
            self._identifiers.add(frame.frame_id)

    def traffic(self, now_s: float) -> ForeignTraffic:
        """Counts at a time in s."""
        return ForeignTraffic(
            frames=self._frames,
            rate_per_s=self._rate.per_s(now_s),
            identifiers=len(self._identifiers),
            kinds=tuple((kind, self._kinds[kind]) for kind in ForeignFrame if self._kinds[kind]),
        )
