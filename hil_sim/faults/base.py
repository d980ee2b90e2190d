"""What every fault has in common: when it acts, and what it is called in reports."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge

from bms.errors import InputError
from bms.validation import NonNegative, Positive, strict

_ROUNDING = 1e-9
"""Share of a period by which a time in s may miss the period it means."""


@strict
@dataclass(frozen=True, kw_only=True)
class Fault(ABC):
    """One fault of a run. Times count from the first period of the charge; without `for_...` it
    lasts for good.

    Raises InputError unless there is one beginning and at most one duration.
    """

    kind: str
    from_s: NonNegative | None = None
    from_period: Annotated[int, Ge(0)] | None = None
    for_s: Positive | None = None
    for_periods: Annotated[int, Ge(1)] | None = None

    needs_own_ecu = False
    """Whether it acts inside the ECU, which then has to run in this process."""
    needs_realtime = False
    """Whether it acts on the wall clock."""

    def __post_init__(self) -> None:
        if (self.from_s is None) == (self.from_period is None):
            raise InputError("give one of from_s and from_period, counted from the charge's start")
        if self.for_s is not None and self.for_periods is not None:
            raise InputError("give for_s or for_periods, or neither for a fault that stays")

    @property
    @abstractmethod
    def where(self) -> str:
        """What it acts on, for reports."""

    def window(self, period_s: float) -> range:
        """Periods of the charge in which it acts."""
        begin = self.from_period
        if begin is None:
            assert self.from_s is not None
            begin = _periods(self.from_s, period_s)
        length = self.for_periods
        if self.for_s is not None:
            length = max(1, _periods(self.for_s, period_s))
        return range(begin, begin + (_FOR_GOOD if length is None else length))

    @property
    def is_for_good(self) -> bool:
        """Whether it lasts until the end of the run."""
        return self.for_s is None and self.for_periods is None


_FOR_GOOD = 1 << 62


def _periods(time_s: float, period_s: float) -> int:
    """Periods that begin before a time."""
    return math.ceil(time_s / period_s - _ROUNDING)
