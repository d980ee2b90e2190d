"""What a charging controller sees and what it answers; the same for firmware and baselines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

ACTIVE_CONSTRAINTS = ("none", "voltage", "soc", "core", "surface", "infeasible", "invalid")
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
    """What a controller is told each period; a controller uses the part that its method assumes."""

    soc: float
    core_temperature_K: float
    surface_temperature_K: float
    coolant_temperature_K: float
    cooling_power_W: float
    reference_current_A: float


class Controller(Protocol):
    """A charging policy."""

    name: str

    def decide(self, observation: Observation) -> Decision:
        """Charging current for the next period."""
        ...
