"""What of a cell changes with its state: resistance, polarisation, entropic coefficient."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bms.arrays import Array
from bms.errors import InputError
from bms.validation import Finite, Positive, strict


@strict
@dataclass(frozen=True)
class ResistanceTable:
    """Ohmic resistance over temperature and state of charge, linear between the points.

    A row of `ohm` belongs to a temperature, a column to a state of charge; beyond the table its
    edge holds. Raises InputError unless both axes rise strictly and the rows fit them.
    """

    temperature_K: tuple[Positive, ...]
    soc: tuple[Finite, ...]
    ohm: tuple[tuple[Positive, ...], ...]

    def __post_init__(self) -> None:
        for name, axis in (("temperature_K", self.temperature_K), ("soc", self.soc)):
            if len(axis) < 1 or not np.all(np.diff(axis) > 0):
                raise InputError(f"cell.resistance.{name}: must rise strictly")
        if len(self.ohm) != len(self.temperature_K) or any(
            len(row) != len(self.soc) for row in self.ohm
        ):
            raise InputError(
                "cell.resistance.ohm: needs a row for each temperature_K, a number for each soc"
            )

    def __call__(self, temperature_K: Any, soc: Any) -> Any:
        """Resistance in ohm at temperatures (K) and states of charge of shapes that broadcast.

        A float for floats.
        """
        if isinstance(temperature_K, float) and isinstance(soc, float):
            return self._at(temperature_K, soc)
        below_T, share_T = _position(self.temperature_K, temperature_K)
        below_s, share_s = _position(self.soc, soc)
        ohm = np.asarray(self.ohm)
        above_T = np.minimum(below_T + 1, len(self.temperature_K) - 1)
        above_s = np.minimum(below_s + 1, len(self.soc) - 1)
        cold = ohm[below_T, below_s] * (1.0 - share_s) + ohm[below_T, above_s] * share_s
        warm = ohm[above_T, below_s] * (1.0 - share_s) + ohm[above_T, above_s] * share_s
        return np.asarray(cold * (1.0 - share_T) + warm * share_T)

    def _at(self, temperature_K: float, soc: float) -> float:
        """The same for two floats, bit by bit, in a tenth of the time."""
        below_T, above_T, share_T = _between(self.temperature_K, temperature_K)
        below_s, above_s, share_s = _between(self.soc, soc)
        colder, warmer = self.ohm[below_T], self.ohm[above_T]
        cold = colder[below_s] * (1.0 - share_s) + colder[above_s] * share_s
        warm = warmer[below_s] * (1.0 - share_s) + warmer[above_s] * share_s
        return cold * (1.0 - share_T) + warm * share_T


@strict
@dataclass(frozen=True)
class EntropyTable:
    """dU/dT over state of charge, linear between the points; beyond the table its edge holds.

    Raises InputError unless the state of charge rises strictly and both have one length.
    """

    soc: tuple[Finite, ...]
    V_per_K: tuple[Finite, ...]

    def __post_init__(self) -> None:
        if len(self.soc) != len(self.V_per_K) or not np.all(np.diff(self.soc) > 0):
            raise InputError("cell.entropy: soc must rise strictly, with one V_per_K for each")

    def __call__(self, soc: Any) -> Any:
        """dU/dT in V/K at states of charge of any shape; a float for a float."""
        if isinstance(soc, float):
            return self._at(soc)
        return np.interp(np.asarray(soc, dtype=np.float64), self.soc, self.V_per_K)

    def _at(self, soc: float) -> float:
        """The same for one float, bit by bit, in a tenth of the time."""
        if soc <= self.soc[0] or len(self.soc) == 1:
            return self.V_per_K[0]
        if soc >= self.soc[-1]:
            return self.V_per_K[-1]
        below, above, _ = _between(self.soc, soc)
        rise_V_per_K = self.V_per_K[above] - self.V_per_K[below]
        slope_V_per_K = rise_V_per_K / (self.soc[above] - self.soc[below])
        return slope_V_per_K * (soc - self.soc[below]) + self.V_per_K[below]


@strict
@dataclass(frozen=True)
class Branch:
    """A resistance with a capacitance beside it: polarisation that comes and goes."""

    resistance_ohm: Positive
    time_constant_s: Positive


def _position(axis: tuple[float, ...], at: npt.ArrayLike) -> tuple[Any, Array]:
    """Index of the point below, and how far from it to the next, both clipped to the axis."""
    points = np.asarray(axis)
    at = np.clip(np.asarray(at, dtype=np.float64), points[0], points[-1])
    below = np.clip(np.searchsorted(points, at, side="right") - 1, 0, max(len(points) - 2, 0))
    if len(points) == 1:
        return below, np.zeros_like(at)
    return below, (at - points[below]) / (points[below + 1] - points[below])


def _between(axis: tuple[float, ...], at: float) -> tuple[int, int, float]:
    """As _position for one float: index below and above, and the share of the way between them."""
    if len(axis) == 1:
        return 0, 0, 0.0
    at = min(max(at, axis[0]), axis[-1])
    below = min(bisect_right(axis, at) - 1, len(axis) - 2)
    return below, below + 1, (at - axis[below]) / (axis[below + 1] - axis[below])
