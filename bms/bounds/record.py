"""What a model file keeps of the three bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Gt, Lt

from bms.validation import Count, Finite, NonNegative, strict

Method = Literal["worst_case", "held_out", "conformal"]


@strict
@dataclass(frozen=True)
class Rate:
    """Range of G in which a distance falls as G^-order: M = constant_K, and the measured exponent.

    In the range no distance exceeds constant_K G^-order.
    """

    first_grid: Count
    last_grid: Count
    constant_K: NonNegative
    exponent: Finite


@strict
@dataclass(frozen=True)
class TheoremBound:
    """Distance of networks of G intervals to a smooth one of their width, for each of `grids`.

    `largest_K` is over data and box, `rms_K` over the data. `order` is k + 1; `rate` is None when
    the distances do not fall as G^-order anywhere. `model_K` is the theorem's bound at the model's
    own G, None unless that lies in the rate's range. `floor_K` is the smooth network's own largest
    error on the data, which no grid can lower, and `floor_rms_K` its RMS.
    """

    grids: tuple[Count, ...]
    largest_K: tuple[NonNegative, ...]
    rms_K: tuple[NonNegative, ...]
    order: Count
    rate: Rate | None
    model_grid: Count
    model_K: NonNegative | None
    floor_K: NonNegative
    floor_rms_K: NonNegative


@strict
@dataclass(frozen=True)
class WorstProfile:
    """A charge from thermal rest at one temperature; each current lasts for its hold time."""

    initial_temperature_K: Finite
    initial_soc: Finite
    cooling_power_W: Finite
    core_limit_K: Finite | None
    current_A: tuple[Finite, ...]
    hold_s: tuple[NonNegative, ...]


@strict
@dataclass(frozen=True)
class WorstCase:
    """Largest error that a search found, and how: profile, time of the error, profiles tried.

    `random_profiles_K` is the largest of profiles drawn at random; `value_K` the larger of both.
    """

    value_K: NonNegative
    searched_K: NonNegative
    random_profiles_K: NonNegative
    profile: WorstProfile
    time_s: NonNegative
    profiles_tried: Count


@strict
@dataclass(frozen=True)
class Conformal:
    """Bound that the largest error of a further unit stays below with at least `confidence`.

    Holds for units that are exchangeable: whole profiles drawn alike are; blocks of one recording
    are only roughly so.
    """

    value_K: NonNegative
    confidence: Annotated[float, Gt(0.0), Lt(1.0)]
    units: Count
    unit: Literal["profile", "block"]


@strict
@dataclass(frozen=True)
class ErrorBounds:
    """The bounds of one model; `used` is the one that e_max is built on.

    The largest of the worst case and of every held-out error is used: it leaves out nothing that is
    known. Without a cell model to search, as for measured data, it is the larger of the conformal
    bound and the largest error, of which `held_out_K` then is that of the whole recording. The
    theorem speaks of the distance between static maps, not of what no static map can see, so that
    it cannot serve alone.
    """

    theorem: TheoremBound
    worst_case: WorstCase | None
    conformal: Conformal
    held_out_K: NonNegative

    @property
    def used(self) -> Method:
        """Name of the bound in use."""
        other_K, name = self._other
        return name if other_K > self.held_out_K else "held_out"

    @property
    def used_K(self) -> float:
        """Value of the bound in use."""
        return max(self._other[0], self.held_out_K)

    @property
    def _other(self) -> tuple[float, Method]:
        if self.worst_case is None:
            return self.conformal.value_K, "conformal"
        return self.worst_case.value_K, "worst_case"
