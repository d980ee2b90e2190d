"""Does the time to full that the firmware tells come true, and one that it is asked for?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from bms.studies.optimum.answer import stated_s
from bms.studies.optimum.bound import lower_bound
from hil_sim.bus.catalog import Mode
from hil_sim.run.result import STOP_COMPLETE
from hil_sim.studies.campaign.engine import CampaignCharge
from hil_sim.studies.campaign.rows import FIRMWARE
from hil_sim.studies.charge_times.controllers import LONGEST_SHARE
from hil_sim.studies.charge_times.native import charge_in_c
from hil_sim.studies.charge_times.starts import Start

FROM_S = 60.0
"""What is told counts from the second minute on."""
STEP_S = 1.0
"""Of the signal: an error of as much is none."""
NOMINAL_ERROR, NOMINAL_SHARE = 0.05, 0.95
"""Largest error of what is left, in at least this share of the nominal cell's charges."""
ASKED_OVER_OPTIMUM = (1.06, 1.2, 1.5, 2.0)
"""Times that are asked for, over physics' bound."""
KEPT_ERROR = 0.01
"""Of a time that was asked for."""


class Listener:
    """Hears what the firmware tells of a charge in each of its periods."""

    def __init__(self) -> None:
        self._told: list[tuple[float, float]] = []

    def __call__(self, charge: CampaignCharge) -> None:
        """A period is over."""
        predicted_s = float(charge.fields.predicted_s)
        if predicted_s >= 0.0:
            self._told.append((float(charge.fields.time_s), predicted_s))

    def worst_error(self, full_after_s: float) -> float | None:
        """Largest error over what was left, from FROM_S on; None where nothing was told then."""
        return worst_error(self._told, full_after_s)

    def worst_share(self, full_after_s: float) -> float | None:
        """The same over the time of the whole charge."""
        errors = _errors_s(self._told, full_after_s)
        return max(error for error, _ in errors) / full_after_s if errors else None


def worst_error(told: Sequence[tuple[float, float]], full_after_s: float) -> float | None:
    """Largest error of predictions (time, time to full, both in s) over what was truly left."""
    errors = _errors_s(told, full_after_s)
    return max(error / left for error, left in errors) if errors else None


def _errors_s(
    told: Sequence[tuple[float, float]], full_after_s: float
) -> list[tuple[float, float]]:
    """Errors beyond the signal's step, each with what was left, of what was told from FROM_S on."""
    foretold = (
        (predicted_s, full_after_s - time_s)
        for time_s, predicted_s in told
        if FROM_S <= time_s < full_after_s
    )
    return [(max(abs(predicted - left) - STEP_S, 0.0), left) for predicted, left in foretold]


@dataclass(frozen=True)
class Asked:
    """A charge that was to be full at a time, beside the fastest one from the same start."""

    over_optimum: float
    asked_s: float
    charge_time_s: float | None
    max_core_temperature_K: float
    fastest_s: float | None
    fastest_max_core_temperature_K: float

    @property
    def is_in_reach(self) -> bool:
        """Whether the fastest charge is full at that time; no other can be asked to be."""
        return self.fastest_s is not None and self.fastest_s <= self.asked_s * (1.0 + KEPT_ERROR)

    @property
    def is_met(self) -> bool:
        """Whether it was full when it should, and cooler than the fastest charge."""
        return (
            self.charge_time_s is not None
            and abs(self.charge_time_s / self.asked_s - 1.0) <= KEPT_ERROR
            and self.max_core_temperature_K < self.fastest_max_core_temperature_K
        )


@dataclass(frozen=True)
class Foretold:
    """The fastest charge from a start, its worst prediction, and charges by a time."""

    start: Start
    optimum_time_s: float
    charge_time_s: float | None
    worst_error: float | None
    asked: tuple[Asked, ...]

    @property
    def came_true(self) -> bool:
        """Whether every prediction from the second minute on was near enough."""
        return self.worst_error is not None and self.worst_error <= NOMINAL_ERROR


def foretell(start: Start) -> Foretold:
    """Charges of one start. Raises InputError without cvxpy."""
    preset, listener = start.loaded(), Listener()
    optimum_s = stated_s(lower_bound(start.charge().physics_alone()))
    longest_s = LONGEST_SHARE * optimum_s
    fastest = charge_in_c(
        preset, FIRMWARE, longest_s, mode=Mode.FASTEST, block_periods=1, told=listener
    )
    fastest_s = _full_after_s(fastest)
    asked = []
    for over in ASKED_OVER_OPTIMUM:
        asked_s = over * optimum_s
        charge = charge_in_c(preset, FIRMWARE, longest_s, mode=Mode.BY_TIME, full_by_s=asked_s)
        asked.append(
            Asked(
                over,
                asked_s,
                _full_after_s(charge),
                charge.fields.peaks.cell.core_temperature_K,
                fastest_s,
                fastest.fields.peaks.cell.core_temperature_K,
            )
        )
    worst = None if fastest_s is None else listener.worst_error(fastest_s)
    return Foretold(start, optimum_s, fastest_s, worst, tuple(asked))


def _full_after_s(charge: CampaignCharge) -> float | None:
    return float(charge.fields.time_s) if charge.outcome == STOP_COMPLETE else None


def prediction_json(rows: Sequence[Foretold]) -> dict[str, Any]:
    """Plain mapping of everything, with `passed`.

    A time that the fastest charge does not make is out of reach: how fast that is, is the
    comparison's subject.
    """
    true = sum(row.came_true for row in rows)
    asked = [one for row in rows for one in row.asked]
    unmet = [one for one in asked if one.is_in_reach and not one.is_met]
    content = {
        "starts": [
            asdict(row.start)
            | {
                "optimum_time_s": row.optimum_time_s,
                "charge_time_s": row.charge_time_s,
                "worst_error": None if row.worst_error is None else round(row.worst_error, 5),
                "came_true": row.came_true,
                "asked": [_asked_json(one) for one in row.asked],
            }
            for row in rows
        ],
        "came_true": true,
        "charges": len(rows),
        "asked": len(asked),
        "out_of_reach": sum(not one.is_in_reach for one in asked),
        "unmet": len(unmet),
    }
    return content | {"passed": true >= NOMINAL_SHARE * len(rows) and not unmet}


def _asked_json(one: Asked) -> dict[str, Any]:
    return {
        "over_optimum": one.over_optimum,
        "asked_s": round(one.asked_s, 2),
        "charge_time_s": one.charge_time_s,
        "max_core_temperature_K": round(one.max_core_temperature_K, 4),
        "is_in_reach": one.is_in_reach,
        "fastest_max_core_temperature_K": round(one.fastest_max_core_temperature_K, 4),
        "is_met": one.is_met,
    }
