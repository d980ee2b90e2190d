"""The argument of a plant's name, as in `pybamm:spme,contact=6e-3`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bms.errors import InputError


@dataclass(frozen=True)
class Range:
    """Values that an option may have, both ends included."""

    least: float
    greatest: float
    unit: str


def split_argument(
    name: str, argument: str, options: Mapping[str, Range]
) -> tuple[str, dict[str, float]]:
    """First part of FIRST,OPTION=NUMBER,... and the options by name.

    Raises InputError for an option that is unknown, given twice or out of its range.
    """
    first, *rest = argument.split(",")
    values: dict[str, float] = {}
    for part in rest:
        option, _, text = part.partition("=")
        where = f"--plant {name}:{argument}: '{part}'"
        if option not in options:
            known = ", ".join(f"{known}=NUMBER" for known in options)
            raise InputError(f"{where} is no option of this plant; it has {known}")
        if option in values:
            raise InputError(f"{where} gives {option} again; give it once")
        allowed = options[option]
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not allowed.least <= value <= allowed.greatest:
            raise InputError(
                f"{where} must be a number from {allowed.least:g} to {allowed.greatest:g} "
                f"{allowed.unit}".rstrip()
            )
        values[option] = value
    return first, values
