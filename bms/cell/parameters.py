"""Parameters of one cell and its cooling; names carry the units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
import numpy.typing as npt
from annotated_types import MaxLen

from bms.arrays import Array
from bms.cell.interval import CellInterval
from bms.cell.tables import Branch, EntropyTable, ResistanceTable
from bms.errors import InputError
from bms.validation import Finite, NonNegative, Positive, strict

SECONDS_PER_HOUR = 3600.0


@strict
@dataclass(frozen=True)
class OpenCircuitVoltage:
    """Open-circuit voltage over state of charge, linear between the points of a table.

    Raises InputError unless both columns have the same length of at least two, the state of
    charge rises from 0 to 1 and the voltage rises with it.
    """

    soc: tuple[Finite, ...]
    voltage_V: tuple[Finite, ...]
    overfill_slope_V: NonNegative = 0.0
    """Rise of the voltage by a whole state of charge beyond 1, so that overfilling is seen."""

    def __post_init__(self) -> None:
        if len(self.soc) != len(self.voltage_V) or len(self.soc) < 2:
            raise InputError("cell.ocv: soc and voltage_V need the same length of at least 2")
        if self.soc[0] != 0.0 or self.soc[-1] != 1.0:
            raise InputError("cell.ocv.soc: must begin at 0 and end at 1")
        if not (np.all(np.diff(self.soc) > 0) and np.all(np.diff(self.voltage_V) > 0)):
            raise InputError("cell.ocv: soc and voltage_V must both rise strictly")

    def __call__(self, soc: npt.ArrayLike) -> Array:
        """Voltage in V at a state of charge of any shape; constant below 0, a slope beyond 1."""
        charge = np.asarray(soc, dtype=np.float64)
        within = np.interp(charge, self.soc, self.voltage_V)
        if self.overfill_slope_V == 0.0:
            return within
        return within + self.overfill_slope_V * np.maximum(charge - 1.0, 0.0)

    def soc_at(self, voltage_V: npt.ArrayLike) -> Array:
        """State of charge at which the voltage (V) is reached; 0 below and 1 above the table."""
        return np.interp(np.asarray(voltage_V, dtype=np.float64), self.voltage_V, self.soc)

    def largest_rise_V(
        self, charge: npt.ArrayLike, first_soc: npt.ArrayLike, last_soc: npt.ArrayLike
    ) -> Array:
        """Largest rise of the voltage (V) by more charge, from any start between two; 0 if none.

        All in state of charge, of any shapes that broadcast. The rise is linear in the start
        between those where either end is a point of the table, so it is greatest at one of them.
        """
        charge, first, last = np.broadcast_arrays(charge, first_soc, last_soc)
        points = np.asarray(self.soc).reshape(-1, *[1] * charge.ndim)
        starts = np.clip(
            np.concatenate([points + np.zeros_like(charge), points - charge]), first, last
        )
        rise_V = np.max(self(starts + charge) - self(starts), axis=0)
        return np.where(first <= last, rise_V, 0.0)


@strict
@dataclass(frozen=True)
class CellParameters:
    """Lumped electro-thermal parameters of one cell with its coolant (paper, cell model).

    The entropic coefficient is dU/dT: with a current that is negative while charging, a positive
    value heats the core during charge. A table or branches that are absent leave the constant.
    """

    capacity_Ah: Positive
    core_resistance_K_per_W: Positive
    core_heat_capacity_J_per_K: Positive
    surface_resistance_K_per_W: Positive
    surface_heat_capacity_J_per_K: Positive
    coolant_heat_capacity_J_per_K: Positive
    ohmic_resistance_ohm: Positive
    entropic_coefficient_V_per_K: Finite
    ocv: OpenCircuitVoltage
    resistance: ResistanceTable | None = None
    branches: Annotated[tuple[Branch, ...], MaxLen(3)] = ()
    entropy: EntropyTable | None = None
    interval: CellInterval | None = None

    @cached_property
    def capacity_As(self) -> float:
        """Capacity in ampere seconds."""
        return self.capacity_Ah * SECONDS_PER_HOUR
