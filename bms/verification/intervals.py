"""Interval arithmetic on arrays, rounded outward by one float64 step in every operation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Union

import numpy as np

Operand = Union["Interval", float]


def _outward(low: Any, high: Any) -> Interval:
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def _ends(value: Operand) -> tuple[Any, Any]:
    return (value.low, value.high) if isinstance(value, Interval) else (value, value)


@dataclass(frozen=True)
class Interval:
    """Lower and upper ends; every operation encloses all values of its operands."""

    low: Any
    high: Any

    def __add__(self, other: Operand) -> Interval:
        low, high = _ends(other)
        return _outward(self.low + low, self.high + high)

    __radd__ = __add__

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Operand) -> Interval:
        return self + (-other)

    def __rsub__(self, other: Operand) -> Interval:
        return -self + other

    def __mul__(self, other: Operand) -> Interval:
        low, high = _ends(other)
        products = (self.low * low, self.low * high, self.high * low, self.high * high)
        return _outward(np.minimum.reduce(products), np.maximum.reduce(products))

    __rmul__ = __mul__

    def square(self) -> Interval:
        """Square, which is never negative."""
        ends = np.stack(np.broadcast_arrays(self.low * self.low, self.high * self.high))
        inside = (self.low <= 0.0) & (self.high >= 0.0)
        return _outward(np.where(inside, 0.0, ends.min(axis=0)), ends.max(axis=0))

    def widened(self, by: Any) -> Interval:
        """Interval with `by` added at both ends."""
        return _outward(self.low - by, self.high + by)

    @property
    def magnitude(self) -> Any:
        """Largest absolute value."""
        return np.maximum(np.abs(self.low), np.abs(self.high))
