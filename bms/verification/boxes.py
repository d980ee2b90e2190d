"""Boxes of states, currents and cooling powers, many at a time, as branch and bound needs them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bms.arrays import Array, Mask
from bms.verification.conditions import Condition
from bms.verification.domain import Domain, Point
from bms.verification.intervals import Interval


@dataclass(frozen=True)
class Boxes:
    """Lower and upper corners of N boxes, both (N, 5) with the columns of Point."""

    low: Array
    high: Array

    @classmethod
    def whole(cls, domain: Domain) -> Boxes:
        """The one box that spans a domain."""
        return cls(
            *(np.array([[float(end) for end in ends]]) for ends in (domain.low, domain.high))
        )

    @classmethod
    def joined(cls, parts: Sequence[Boxes]) -> Boxes:
        """The boxes of all parts; no boxes for no parts."""
        none = np.empty((0, len(Point._fields)))
        return cls(
            np.concatenate([none, *(part.low for part in parts)]),
            np.concatenate([none, *(part.high for part in parts)]),
        )

    def __len__(self) -> int:
        return len(self.low)

    @cached_property
    def surface_K(self) -> Interval:
        """Surface temperature Ts."""
        return self._side(0)

    @cached_property
    def core_gap_K(self) -> Interval:
        """Tc - Ts."""
        return self._side(1)

    @cached_property
    def coolant_gap_K(self) -> Interval:
        """Ts - Tinf."""
        return self._side(2)

    @cached_property
    def current_A(self) -> Interval:
        """Current, negative while charging."""
        return self._side(3)

    @cached_property
    def cooling_W(self) -> Interval:
        """Cooling power."""
        return self._side(4)

    @cached_property
    def core_K(self) -> Interval:
        """Core temperature Tc."""
        return self.surface_K + self.core_gap_K

    @cached_property
    def coolant_K(self) -> Interval:
        """Coolant temperature Tinf."""
        return self.surface_K - self.coolant_gap_K

    def value(self, condition: Condition) -> Interval:
        """Enclosure of a condition's left-hand side without its error term."""
        c = condition
        return (
            self.core_gap_K * c.core_gap
            - self.coolant_gap_K * c.coolant_gap
            + (c.limit_K - self.surface_K) * c.room
            + self.core_K * self.current_A * c.coupling
            + self.current_A.square() * c.squared
            + self.cooling_W * c.cooling
            - c.reserve
        )

    def halved(self, scores: Array) -> Boxes:
        """Both halves of every box, cut across its side of the highest score, scores (N, 5)."""
        rows, side = np.arange(len(self)), np.argmax(scores, axis=1)
        middle = 0.5 * (self.low[rows, side] + self.high[rows, side])
        upper_low, lower_high = self.low.copy(), self.high.copy()
        upper_low[rows, side] = middle
        lower_high[rows, side] = middle
        return Boxes.joined([Boxes(self.low, lower_high), Boxes(upper_low, self.high)])

    def middles(self) -> Boxes:
        """The middle of every box, as a box without extent."""
        middle = 0.5 * (self.low + self.high)
        return Boxes(middle, middle)

    def batches(self, largest: int) -> Iterator[Boxes]:
        """The boxes in their order, at most so many at a time."""
        for start in range(0, len(self), largest):
            yield self[slice(start, start + largest)]

    def __getitem__(self, rows: slice | Mask) -> Boxes:
        return Boxes(self.low[rows], self.high[rows])

    def _side(self, column: int) -> Interval:
        return Interval(self.low[:, column], self.high[:, column])
