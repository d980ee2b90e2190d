"""What a charging controller sees and what it answers; the same for firmware and baselines."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

ACTIVE_CONSTRAINTS = (
    "none",
    "voltage",
    "soc",
    "core",
    "surface",
    "infeasible",
    "invalid",
    "map",
    "core_unknown",
)
"""Names in the order of the firmware's enumeration rcbf_active_t."""


class ConstraintMargins(NamedTuple):
    """Left-hand sides of the four constraints at the chosen current (V, 1/s, K/s, K/s^2)."""

    voltage_V: float
    soc_per_s: float
    core_K_per_s: float
    surface_K_per_s2: float


@dataclass(frozen=True)
class Decision:
    """A charging current with its reason.

    lower_A..upper_A is the interval that all constraints and the reference allow; it is empty
    (lower above upper) and the current 0 A when feasible is false.
    """

    current_A: float
    feasible: bool
    active_constraint: str
    lower_A: float
    upper_A: float
    margins: ConstraintMargins


class Observation(NamedTuple):
    """What a controller is told each period; a controller uses the part that its method assumes.

    NaN stands for what it is not told: a controller that only measures has no core temperature,
    one that is given the true state needs neither voltage nor current of the last period.
    """

    soc: float
    core_temperature_K: float
    surface_temperature_K: float
    coolant_temperature_K: float
    cooling_power_W: float
    reference_current_A: float
    voltage_V: float = math.nan
    current_A: float = math.nan


NO_MARGINS = ConstraintMargins(math.nan, math.nan, math.nan, math.nan)
"""Of a decision without barrier constraints."""

INVALID = Decision(0.0, False, "invalid", math.inf, -math.inf, NO_MARGINS)
"""The answer to an observation that cannot be used."""


class Controller(Protocol):
    """A charging policy."""

    name: str

    def decide(self, observation: Observation) -> Decision:
        """Charging current for the next period."""
        ...
