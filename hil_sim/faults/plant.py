"""Faults of what acts on the cell: the charger and the coolant pump."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Literal

from bms.validation import NonNegative, strict
from hil_sim.faults.base import Fault


class ChargerFault(Fault):
    """Supplies another current than the charger's rule gives."""

    @property
    def where(self) -> str:
        """The charger, in words."""
        return "charger"

    @abstractmethod
    def current_A(self, obedient_A: float, last_A: float) -> float:
        """Current of the coming period from the one the rule gives and the last one, in A."""


@strict
@dataclass(frozen=True, kw_only=True)
class ChargerStuck(ChargerFault):
    """The charger ignores commands and keeps its current."""

    kind: Literal["charger-stuck"]

    def current_A(self, obedient_A: float, last_A: float) -> float:
        """The current of the last period, whatever the rule gives."""
        return last_A


@strict
@dataclass(frozen=True, kw_only=True)
class ChargerGain(ChargerFault):
    """The charger supplies a multiple of what is commanded."""

    kind: Literal["charger-gain"]
    factor: NonNegative

    def current_A(self, obedient_A: float, last_A: float) -> float:
        """`factor` times the current that the rule gives."""
        return self.factor * obedient_A


@strict
@dataclass(frozen=True, kw_only=True)
class PumpFailed(Fault):
    """No cooling power any more; the report says so, or goes on as before."""

    kind: Literal["pump-failed"]
    reported: Literal["failed", "healthy"]

    @property
    def where(self) -> str:
        """The coolant pump, and what its report says."""
        return f"coolant pump, reported {self.reported}"


PLANT_FAULTS = (ChargerStuck, ChargerGain, PumpFailed)
