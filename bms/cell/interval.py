"""How far a cell may be from the nominal one: the family that a preset speaks for."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated

from annotated_types import Gt, Le

from bms.errors import refuse
from bms.validation import NonNegative, Positive, strict

Factors = tuple[Positive, Positive]
"""Least and greatest factor on a nominal value."""


@strict
@dataclass(frozen=True)
class CellInterval:
    """Intervals of a family of cells: factors on the nominal parameters, and additions.

    `resistance` scales the ohmic resistance, `polarisation` that of the branches; no branch has a
    longer time constant than `longest_relaxation_s`. `capacity` covers age, `ocv_error_V` spread
    and hysteresis of the open-circuit voltage, `entropic_error_V_per_K` that of dU/dT. Raises
    InputError unless each interval rises and holds the nominal cell.
    """

    core_resistance: Factors
    core_heat_capacity: Factors
    surface_resistance: Factors
    surface_heat_capacity: Factors
    coolant_heat_capacity: Factors
    resistance: Factors
    polarisation: tuple[NonNegative, NonNegative]
    capacity: Factors
    entropic_error_V_per_K: NonNegative
    ocv_error_V: NonNegative
    longest_relaxation_s: Annotated[float, Gt(0.0), Le(3600.0)]

    def __post_init__(self) -> None:
        refuse(
            f"cell.interval.{name}: must rise and hold 1, the nominal cell"
            for name, value in ((field.name, getattr(self, field.name)) for field in fields(self))
            if isinstance(value, tuple) and not value[0] <= 1.0 <= value[1]
        )
