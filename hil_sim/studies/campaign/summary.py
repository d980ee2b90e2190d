"""What a campaign shows: counts with exact confidence bounds, and how the peaks are spread."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from scipy.stats import binomtest

from bms.arrays import Array, Mask
from hil_sim.studies.campaign.engine import CONTROLLERS
from hil_sim.studies.campaign.rows import FIRMWARE, prefix
from hil_sim.studies.campaign.settings import CampaignSettings

CONFIDENCE = 0.95
CLASSES = ("inside", "outside")
"""Whether the error of the nominal model kept within the preset's uncertainty bounds all along."""

_QUANTILES = {"min": 0.0, "p5": 0.05, "median": 0.5, "p95": 0.95, "max": 1.0}

Rows = list[dict[str, str]]


def limits(settings: CampaignSettings) -> dict[str, tuple[str, float]]:
    """Column of the peak and largest allowed value of each limit."""
    preset = settings.preset.limits
    return {
        "core": ("max_core_temperature_K", preset.max_core_temperature_K),
        "surface": ("max_surface_temperature_K", preset.max_surface_temperature_K),
        "voltage": ("max_voltage_V", preset.max_voltage_V),
        "soc": ("max_soc", preset.max_soc),
    }


def column(rows: Rows, name: str) -> Array:
    """Numbers of a column, NaN where it is empty."""
    return np.array([float(row[name] or "nan") for row in rows])


def summarise(settings: CampaignSettings, rows: Rows) -> dict[str, Any]:
    """Plain mapping for summary.json, without anything that depends on the wall clock."""
    inside = column(rows, "inside") == 1.0
    masks = {"inside": inside, "outside": ~inside}
    families = Counter((row["family"], row["inside"] == "1") for row in rows)
    error_bound_K = settings.model.error_bound_K
    exceeded = column(rows, "max_estimate_error_K") > error_bound_K
    return settings.identity() | {
        "confidence": CONFIDENCE,
        "classes": {
            name: {
                "runs": int(mask.sum()),
                "by_family": {
                    family: count
                    for (family, is_inside), count in sorted(families.items())
                    if is_inside == (name == "inside")
                },
                "estimate_beyond_error_bound": int((exceeded & mask).sum()),
                "controllers": {
                    controller: _figures(settings, rows, mask, controller)
                    for controller in CONTROLLERS
                },
            }
            for name, mask in masks.items()
        },
        "estimation_error_bound_K": error_bound_K,
    }


def firmware_is_safe(summary: dict[str, Any]) -> bool:
    """Whether the firmware kept every limit for every cell inside the modelled uncertainty."""
    figures = summary["classes"]["inside"]["controllers"][FIRMWARE]
    return bool(figures["violations"]["any"]["count"] == 0)


def _figures(settings: CampaignSettings, rows: Rows, mask: Mask, controller: str) -> dict[str, Any]:
    name = prefix(controller)
    crossed = {
        limit: (column(rows, f"{name}_{peak}") > allowed) & mask
        for limit, (peak, allowed) in limits(settings).items()
    }
    crossed["any"] = np.logical_or.reduce(list(crossed.values()))
    runs = int(mask.sum())
    outcomes = Counter(row[f"{name}_outcome"] for row, wanted in zip(rows, mask) if wanted)
    peaks = {peak: f"{name}_{peak}" for peak, _ in limits(settings).values()}
    return {
        "violations": {
            limit: probability(int(hits.sum()), runs) for limit, hits in crossed.items()
        },
        "outcomes": dict(sorted(outcomes.items())),
        "peaks": {peak: quantiles(column(rows, of)[mask]) for peak, of in peaks.items()},
        "charge_time_s": quantiles(column(rows, f"{name}_charge_time_s")[mask]),
    }


def probability(count: int, runs: int) -> dict[str, float | int | None]:
    """Share with its two-sided Clopper-Pearson interval; nothing is known from no run."""
    if runs == 0:
        return {"count": 0, "probability": None, "low": None, "high": None}
    interval = binomtest(count, runs).proportion_ci(CONFIDENCE, method="exact")
    return {
        "count": count,
        "probability": count / runs,
        "low": float(interval.low),
        "high": float(interval.high),
    }


def quantiles(values: Array) -> dict[str, float] | None:
    """Least, greatest and three quantiles of the numbers that are known; None without any."""
    known = values[~np.isnan(values)]
    if known.size == 0:
        return None
    return {name: float(np.quantile(known, share)) for name, share in _QUANTILES.items()}
