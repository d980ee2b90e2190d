"""What a campaign over a preset's family shows: what went wrong, how often, and the worst runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from bms.arrays import Array, Mask
from hil_sim.studies.campaign.engine import CONTROLLERS
from hil_sim.studies.campaign.rows import FIRMWARE, prefix
from hil_sim.studies.campaign.settings import CampaignSettings
from hil_sim.studies.campaign.summary import (
    CONFIDENCE,
    Rows,
    column,
    limits,
    probability,
    quantiles,
)

OVERFILLED_SOC = 1.005
"""True state of charge above which a cell is overfilled."""
UNFILLED_SOC = 0.03
"""By which the true state of charge may at most be below that of completion at "complete"."""
LEAST_COMPLETE_SHARE = 0.99
"""Share of the charges that have to be complete within the time limit."""
WORST_RUNS = 3


def summarise_family(settings: CampaignSettings, rows: Rows) -> dict[str, Any]:
    """Plain mapping for summary.json, without anything that depends on the wall clock."""
    exceeded = column(rows, "max_estimate_error_K") > settings.model.error_bound_K
    return settings.identity() | {
        "confidence": CONFIDENCE,
        "estimation_error_bound_K": settings.model.error_bound_K,
        "estimate_beyond_error_bound": int(exceeded.sum()),
        "controllers": {name: _figures(settings, rows, name) for name in CONTROLLERS},
        "first_faults": dict(
            sorted(Counter(r["first_fault"] for r in rows if r["first_fault"]).items())
        ),
    }


def family_is_safe(summary: Mapping[str, Any]) -> bool:
    """Whether the firmware did nothing wrong on any cell, and charged enough of them in time."""
    figures = summary["controllers"][FIRMWARE]
    wrong = sum(violation["count"] for violation in figures["violations"].values())
    return bool(wrong == 0 and figures["complete"]["share"] >= LEAST_COMPLETE_SHARE)


def _figures(settings: CampaignSettings, rows: Rows, controller: str) -> dict[str, Any]:
    name, runs = prefix(controller), len(rows)
    outcomes = np.array([row[f"{name}_outcome"] for row in rows])
    final_soc = column(rows, f"{name}_final_soc")
    stops = column(rows, f"{name}_stops")
    excesses = _excesses(settings, rows, name)
    full_soc = settings.preset.limits.completion_soc
    excesses["unfilled"] = np.where(
        outcomes == "complete", full_soc - UNFILLED_SOC - final_soc, -np.inf
    )
    excesses["fault"] = np.where(np.isin(outcomes, ("fault", "not-ready")), 1.0, -np.inf)
    is_complete = outcomes == "complete"
    peaks = [peak for peak, _ in limits(settings).values()]
    return {
        "violations": {
            kind: probability(int(np.sum(excess > 0.0)), runs) | {"worst": _worst(rows, excess)}
            for kind, excess in excesses.items()
        },
        "outcomes": dict(sorted(Counter(outcomes.tolist()).items())),
        "complete": _share(is_complete),
        "full": _share(is_complete & (final_soc >= full_soc)),
        "stops": {
            "runs": int(np.sum(stops > 0)),
            "total": int(stops.sum()),
            "worst": _worst(rows, stops),
        },
        "peaks": {peak: quantiles(column(rows, f"{name}_{peak}")) for peak in peaks},
        "final_soc": quantiles(final_soc),
        "charge_time_s": quantiles(column(rows, f"{name}_charge_time_s")),
    }


def _excesses(settings: CampaignSettings, rows: Rows, name: str) -> dict[str, Array]:
    """By how much each limit was crossed, negative where it was kept."""
    allowed = limits(settings) | {"soc": ("max_soc", OVERFILLED_SOC)}
    return {
        limit: column(rows, f"{name}_{peak}") - largest
        for limit, (peak, largest) in allowed.items()
    }


def _share(mask: Mask) -> dict[str, Any]:
    return {"count": int(mask.sum()), "share": float(mask.mean())}


def _worst(rows: Rows, excess: Array) -> list[dict[str, Any]]:
    """Numbers of the runs with the largest excess, largest first; none where none exceeds."""
    order = np.argsort(-excess, kind="stable")[:WORST_RUNS]
    return [
        {"run": int(rows[index]["run"]), "by": float(excess[index])}
        for index in order
        if excess[index] > 0.0
    ]
