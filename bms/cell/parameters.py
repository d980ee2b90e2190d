"""Parameters of one cell and its cooling; names carry the units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bms.arrays import Array
from bms.errors import InputError
from bms.validation import Finite, Positive, strict

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

    def __post_init__(self) -> None:
        if len(self.soc) != len(self.voltage_V) or len(self.soc) < 2:
            raise InputError("cell.ocv: soc and voltage_V need the same length of at least 2")
        if self.soc[0] != 0.0 or self.soc[-1] != 1.0:
            raise InputError("cell.ocv.soc: must begin at 0 and end at 1")
        if not (np.all(np.diff(self.soc) > 0) and np.all(np.diff(self.voltage_V) > 0)):
            raise InputError("cell.ocv: soc and voltage_V must both rise strictly")

    def __call__(self, soc: npt.ArrayLike) -> Array:
        """Voltage in V at a state of charge of any shape; held constant outside 0..1."""
        return np.interp(np.asarray(soc, dtype=np.float64), self.soc, self.voltage_V)

    def slopes_V(self) -> Array:
        """Slope dV/dSoC in V of each table segment."""
        return np.diff(self.voltage_V) / np.diff(self.soc)


@strict
@dataclass(frozen=True)
class CellParameters:
    """Lumped electro-thermal parameters of one cell with its coolant (paper, cell model).

    The entropic coefficient is dU/dT: with a current that is negative while charging, a positive
    value heats the core during charge.
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

    @cached_property
    def capacity_As(self) -> float:
        """Capacity in ampere seconds."""
        return self.capacity_Ah * SECONDS_PER_HOUR
