"""What the shape of a cell tells of its core's thermal resistance and of its surface's share."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bms.errors import InputError

Interval = tuple[float, float]

RADIAL_W_PER_MK: tuple[float, float, float] = (0.2, 0.45, 1.0)
"""Least, middle, greatest conductivity across the layers of a wound cell.

Drake et al. 2014 (J. Power Sources 252) measured 0.20 W/(m K) on a 18650; others found more, and
dry layers less. Assumed wide for a cell that nobody has measured.
"""
THROUGH_W_PER_MK: tuple[float, float, float] = (0.3, 0.7, 1.5)
"""The same through the layers of a stacked or flat wound cell, where they are pressed together."""
SURFACE_SHARE: tuple[float, float, float] = (0.04, 0.08, 0.15)
"""Share of the cell's heat capacity that follows the surface: can or film, and the outer layers."""
_WH_PER_M3 = 5.0e5
"""Energy density, 3e5 to 7e5 in cells of today."""


@dataclass(frozen=True)
class Shape:
    """A cell's shape: resistance from the hottest point to the surface for a conductivity of 1."""

    name: str
    unit_resistance_per_m: float
    conductivity_W_per_mK: tuple[float, float, float]
    volume_m3: float

    @property
    def core_resistance_K_per_W(self) -> tuple[float, float, float]:
        """Least, middle and greatest."""
        low, middle, high = self.conductivity_W_per_mK
        unit = self.unit_resistance_per_m
        return unit / high, unit / middle, unit / low

    @property
    def source(self) -> str:
        """Where the resistance comes from, in words."""
        low, middle, high = self.conductivity_W_per_mK
        return (
            f"not measured: geometry {self.name} with heat made evenly inside and a conductivity "
            f"of {middle:g} W/(m K), {low:g} to {high:g} in publications"
        )


def shape(text: str) -> Shape:
    """Shape of a name such as 18650, cylinder:18x65, prismatic:148x27x97 or pouch:200x150x8 (mm).

    Cylinders conduct radially, 1/(4 pi k L); the others through half of their thickness, t/(8 k A),
    cooled on both faces: the steady difference between the hottest point and the surface where heat
    is made evenly. InputError names what is wrong.
    """
    kind, _, sizes_mm = text.partition(":")
    if kind.isdigit() and len(kind) == 5 and not sizes_mm:
        return _cylinder(text, 1e-3 * float(kind[:2]), 1e-4 * float(kind[2:]))
    try:
        sizes = [1e-3 * float(part) for part in sizes_mm.lower().split("x")]
        if not all(0.0 < size < 2.0 for size in sizes):
            raise ValueError
        return _SHAPES[kind](text, *sizes)
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f"--geometry {text}: give 18650, 21700, 26650, another five figures of that kind, "
            "cylinder:DIAMETERxLENGTH, prismatic:AxBxC or pouch:AxBxC in mm"
        ) from None


def _cylinder(name: str, diameter_m: float, length_m: float) -> Shape:
    volume_m3 = math.pi * diameter_m**2 / 4.0 * length_m
    return Shape(name, 1.0 / (4.0 * math.pi * 0.93 * length_m), RADIAL_W_PER_MK, volume_m3)


def _flat(name: str, *sides_m: float) -> Shape:
    if len(sides_m) != 3:
        raise ValueError
    thickness_m, width_m, height_m = sorted(sides_m)
    return Shape(
        name,
        thickness_m / (8.0 * width_m * height_m),
        THROUGH_W_PER_MK,
        thickness_m * width_m * height_m,
    )


_SHAPES: Mapping[str, Callable[..., Shape]] = {
    "cylinder": _cylinder,
    "prismatic": _flat,
    "pouch": _flat,
}


def shape_of_capacity(energy_Wh: float) -> Shape:
    """A cylinder for a cell of unknown shape, with every published conductivity in its interval."""
    volume_m3 = energy_Wh / _WH_PER_M3
    diameter_m = (4.0 * volume_m3 / (math.pi * 3.4)) ** (1.0 / 3.0)
    guessed = _cylinder("not given, a cylinder of its energy", diameter_m, 3.4 * diameter_m)
    wide = (0.7 * RADIAL_W_PER_MK[0], RADIAL_W_PER_MK[1], 1.5 * RADIAL_W_PER_MK[2])
    return Shape(guessed.name, guessed.unit_resistance_per_m, wide, volume_m3)
