"""Both bounds of a charge, side by side, and charges that come close to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.studies.optimum.bound import SAMPLES, Bound, lower_bound
from bms.studies.optimum.charge import Charge
from bms.studies.optimum.riding import best_constant, best_following

STATED_S = 0.1
"""A bound is stated in whole tenths of a second, rounded down."""


@dataclass(frozen=True)
class Case:
    """A charge, its bound, and the times in s of the best charges played; None of those absent."""

    name: str
    charge: Charge
    bound: Bound
    constant_s: float | None
    following_s: float | None

    @property
    def stated_s(self) -> float:
        """The bound in s as it is told."""
        return stated_s(self.bound)

    @property
    def reached_s(self) -> float | None:
        """The fastest charge that was played, in s."""
        return min(
            (time_s for time_s in (self.constant_s, self.following_s) if time_s is not None),
            default=None,
        )

    def to_json(self) -> dict[str, Any]:
        """Figures and profile as plain values."""
        ends_s = self.bound.time_s * np.arange(self.bound.samples + 1) / self.bound.samples
        return {
            "name": self.name,
            "time_s": self.stated_s,
            "slack_s": round(self.bound.slack_s, 2),
            "constant_then_riding_s": _rounded(self.constant_s),
            "reached_s": _rounded(self.reached_s),
            "samples": self.bound.samples,
            "profile": {
                "end_s": np.round(ends_s[1:], 3).tolist(),
                "current_A": np.round(-self.bound.current_A, 4).tolist(),
                "soc": np.round(self.bound.soc[1:], 6).tolist(),
                "core_temperature_K": _column(self.bound, 0),
                "surface_temperature_K": _column(self.bound, 1),
                "coolant_temperature_K": _column(self.bound, 2),
            },
        }


def stated_s(bound: Bound) -> float:
    """A bound in whole tenths of a second, rounded down."""
    return round(int(bound.time_s / STATED_S) * STATED_S, 1)


def cases(
    charge: Charge,
    *,
    with_ramp: bool = True,
    samples: int = SAMPLES,
    told: Callable[[int, str], None] = lambda done, doing: None,
) -> list[Case]:
    """Physics alone, and with the ramp and map of the charge; `told` hears how many are
    complete, and what is done.

    Raises InputError as lower_bound does.
    """
    wanted = [("physics alone", charge.physics_alone())]
    if with_ramp:
        parts = "ramp" if charge.current_map is None else "ramp and current map"
        wanted.append((f"with {parts}", charge))
    return [
        _case(name, one, samples, partial(told, done)) for done, (name, one) in enumerate(wanted)
    ]


def _case(name: str, charge: Charge, samples: int, told: Callable[[str], None]) -> Case:
    bound = lower_bound(charge, samples, lambda time_s: told(f"{name}: trying {time_s:.1f} s"))
    told(f"{name}: playing charges")
    constant, following = best_constant(charge), best_following(charge, bound)
    return Case(
        name,
        charge,
        bound,
        None if constant is None else constant.time_s,
        None if following is None else following.time_s,
    )


def _column(bound: Bound, which: int) -> list[float]:
    column: Array = np.round(bound.temperatures_K[1:, which], 3)
    return [float(value) for value in column]


def _rounded(time_s: float | None) -> float | None:
    return None if time_s is None else round(time_s, 1)
