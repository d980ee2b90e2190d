"""Histograms of a campaign: peak temperatures against their limits, and charging times."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bms.arrays import Array, Mask
from hil_sim.report.chart import CONTROLLER_COLOURS, LIMIT_COLOUR
from hil_sim.studies.campaign.engine import CONTROLLERS
from hil_sim.studies.campaign.rows import prefix
from hil_sim.studies.campaign.settings import CampaignSettings, CellFamily
from hil_sim.studies.campaign.summary import Rows, column, limits

_BINS = 60
_TITLES = {
    "inside": "cells inside the modelled uncertainty",
    "outside": "cells outside the modelled uncertainty",
}


def save_histograms(settings: CampaignSettings, rows: Rows, path: Path) -> None:
    """Write a PNG with one row of panels for each class of cells; a family is one class."""
    allowed = limits(settings)
    panels = (
        ("max_core_temperature_K", "peak core temperature in K", allowed["core"][1]),
        ("max_surface_temperature_K", "peak surface temperature in K", allowed["surface"][1]),
        ("charge_time_s", "charging time in s", None),
    )
    classes = _classes(settings, rows)
    figure = Figure(figsize=(13, 3.5 * len(classes)), layout="constrained")
    axes = figure.subplots(len(classes), len(panels), squeeze=False)
    for line, (title, mask) in zip(axes, classes.items()):
        for axis, (quantity, label, limit) in zip(line, panels):
            values = {
                controller: column(rows, f"{prefix(controller)}_{quantity}")[mask]
                for controller in CONTROLLERS
            }
            known = np.concatenate(list(values.values()))
            known = known[~np.isnan(known)]
            if known.size:
                bins = _edges(known, limit)
                for (controller, numbers), colour in zip(values.items(), CONTROLLER_COLOURS):
                    axis.hist(numbers, bins, histtype="step", label=controller, color=colour)
            if limit is not None:
                axis.axvline(limit, color=LIMIT_COLOUR, linestyle="--", linewidth=1)
            axis.set_xlabel(label)
            axis.set_ylabel("runs")
            axis.set_yscale("symlog")
            axis.set_title(f"{title} ({int(mask.sum())} runs)", fontsize=9)
    axes[0][0].legend()
    figure.suptitle(f"{settings.preset.name}, {settings.runs} runs, seed {settings.seed}")
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _classes(settings: CampaignSettings, rows: Rows) -> dict[str, Mask]:
    """Title of each class, and which rows are of it."""
    if settings.family is CellFamily.REAL:
        return {"cells of the preset's family": np.ones(len(rows), dtype=bool)}
    inside = column(rows, "inside") == 1.0
    return {_TITLES["inside"]: inside, _TITLES["outside"]: ~inside}


def _edges(values: Array, limit: float | None) -> Array:
    """Edges of bins over all values; a limit is one of them, so that no bin straddles it."""
    low, high = float(values.min()), float(values.max())
    width = (high - low) / _BINS or 1.0
    anchor = low if limit is None else limit
    first, last = math.floor((low - anchor) / width), math.ceil((high - anchor) / width)
    return np.asarray(anchor + width * np.arange(first, last + 2), dtype=np.float64)
