"""The lower bound: the longest duration in which, by proof, the cell cannot be filled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.errors import InputError
from bms.studies.optimum.certificate import most_charge_As
from bms.studies.optimum.charge import Charge
from bms.studies.optimum.program import Answer, solve
from bms.studies.optimum.relaxation import Relaxation, relax

SAMPLES = 300
TOLERANCE_S = 0.02
LONGEST_S = 36_000.0
_MOST_PROGRAMS = 25


@dataclass(frozen=True)
class Bound:
    """No controller fills the cell in less than time_s while it keeps the limits.

    `slack_s` is by how much a finer sampling could raise the bound at most, about: the program's
    own answer, which no proof supports, fills the cell that much later. Over the `samples` of the
    bound's duration current_A (N,) is the program's current, temperatures_K (N + 1, 3) its core,
    surface and coolant, and soc (N + 1,) its state of charge.
    """

    time_s: float
    slack_s: float
    current_A: Array
    temperatures_K: Array
    soc: Array

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return len(self.current_A)


@dataclass(frozen=True)
class _Trial:
    relaxation: Relaxation
    answer: Answer
    most_As: float

    @property
    def duration_s(self) -> float:
        return self.relaxation.ranges.duration_s

    @property
    def lack_As(self) -> float:
        """What is certain to be missing at the end; the duration is a bound where it is above 0."""
        return self.relaxation.charge.needed_As - self.most_As


def lower_bound(
    charge: Charge, samples: int = SAMPLES, told: Callable[[float], None] = lambda duration_s: None
) -> Bound:
    """Longest duration, to TOLERANCE_S, whose certificate leaves the cell less than full.

    A controller that is full earlier would keep the limits at rest, too, and so be one of that
    duration. `told` hears each duration that is tried. Raises InputError without cvxpy, and where
    no charge ends within LONGEST_S.
    """

    def tried(duration_s: float) -> _Trial:
        told(duration_s)
        relaxation = relax(charge, duration_s, samples)
        answer = solve(relaxation)
        return _Trial(relaxation, answer, most_charge_As(relaxation, answer.multipliers))

    too_short = tried(charge.needed_As / charge.strongest_A)
    enough: _Trial | None = None
    slope_A = 0.5 * charge.strongest_A
    for _ in range(_MOST_PROGRAMS):
        duration_s = _next_duration_s(too_short, enough, slope_A)
        if too_short.duration_s >= LONGEST_S:
            raise InputError(
                f"optimum: by proof no controller fills the cell within {LONGEST_S:.0f} s; "
                "more cooling, or a colder start"
            )
        trial = tried(min(duration_s, LONGEST_S))
        slope_A = _slope_A(trial, too_short, enough, slope_A)
        if trial.lack_As > 0.0:
            too_short = trial
            if trial.lack_As <= slope_A * TOLERANCE_S:
                break
        else:
            enough = trial
    return _bound(too_short, slope_A)


def _next_duration_s(too_short: _Trial, enough: _Trial | None, slope_A: float) -> float:
    """Where the lack is a quarter of the tolerance, by the slope; inside of what is known."""
    wanted_s = too_short.duration_s + too_short.lack_As / slope_A - 0.25 * TOLERANCE_S
    if enough is None:
        return min(max(wanted_s, too_short.duration_s * 1.001), 2.0 * too_short.duration_s)
    low_s, high_s = too_short.duration_s, enough.duration_s
    width_s = high_s - low_s
    nearest_s = high_s + enough.lack_As / slope_A - 0.25 * TOLERANCE_S
    if abs(enough.lack_As) < too_short.lack_As:
        wanted_s = nearest_s
    return min(max(wanted_s, low_s + 0.02 * width_s), high_s - 0.02 * width_s)


def _slope_A(trial: _Trial, too_short: _Trial, enough: _Trial | None, before_A: float) -> float:
    """Growth of the charge with the duration, by the trial and the nearest one before it."""
    others = [too_short, *([] if enough is None else [enough])]
    nearest = min(others, key=lambda other: abs(other.duration_s - trial.duration_s))
    apart_s = trial.duration_s - nearest.duration_s
    if abs(apart_s) < 0.01 * TOLERANCE_S:
        return before_A
    slope_A = (trial.most_As - nearest.most_As) / apart_s
    strongest_A = trial.relaxation.charge.strongest_A
    return float(np.clip(slope_A, 0.01 * strongest_A, strongest_A))


def _bound(trial: _Trial, slope_A: float) -> Bound:
    charge, step_s = trial.relaxation.charge, trial.relaxation.ranges.step_s
    charged = np.concatenate([[0.0], np.cumsum(trial.answer.current_A)])
    return Bound(
        time_s=trial.duration_s,
        slack_s=max(charge.needed_As - trial.answer.charge_As, 0.0) / slope_A,
        current_A=trial.answer.current_A,
        temperatures_K=trial.answer.temperatures_K,
        soc=charge.start_soc + charged * step_s / charge.cell.capacity_As,
    )
