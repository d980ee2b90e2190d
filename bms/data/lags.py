"""Lagged inputs: what low-pass filters remember of the current and of the surface temperature.

One sample cannot show the cell's fast thermal mode; how the inputs came about can.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from bms.arrays import Array
from bms.validation import Positive, strict

Quantity = Literal["current_squared_A2", "surface_temperature_rise_K"]
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)
"""In the order of the firmware's kan_quantity_t."""
_SETTLING = 5.0


@strict
@dataclass(frozen=True)
class Lag:
    """A first-order low-pass of one quantity, as a further input of the network.

    "current_squared_A2" gives the filtered square of the current, "surface_temperature_rise_K" the
    surface temperature less its filtered value: the same information, without 300 K in it, of which
    float32 would lose the last digits.
    """

    quantity: Quantity
    time_constant_s: Positive

    @property
    def input_name(self) -> str:
        """Name of the input, such as current_squared_A2_filtered_10s."""
        return f"{self.quantity}_filtered_{self.time_constant_s:g}s"

    def decay(self, step_s: float) -> float:
        """Share of the former value that is left after a step."""
        return math.exp(-step_s / self.time_constant_s)

    def gain(self, step_s: float) -> float:
        """Factor of the step's current squared, or of the surface temperature's change in it."""
        fresh = 1.0 - self.decay(step_s)
        if self.quantity == "current_squared_A2":
            return fresh
        return fresh * self.time_constant_s / step_s


Lags = tuple[Lag, ...]


def at_rest(lags: Lags, profiles: int) -> Array:
    """Filter values (lags, profiles) of cells that have rested: no current, no rise."""
    return np.zeros((len(lags), profiles))


def step(
    lags: Lags,
    values: Array,
    step_s: float,
    current_A: Array | float,
    surface_temperature_change_K: Array | float,
) -> Array:
    """Filter values (lags, ...) after a step in which the current flowed.

    Exact for a constant current and a temperature that changes evenly.
    """
    after = np.empty_like(values)
    for row, lag in enumerate(lags):
        is_current = lag.quantity == "current_squared_A2"
        drive = np.square(current_A) if is_current else surface_temperature_change_K
        after[row] = lag.decay(step_s) * values[row] + lag.gain(step_s) * drive
    return after


def settling_time_s(lags: Lags) -> float:
    """Time after which less than 1 % of a wrong start is left in any filter."""
    return _SETTLING * max((lag.time_constant_s for lag in lags), default=0.0)
