"""What the rows of a study of packs say together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bms.bus_signals import BUS
from hil_sim.studies.pack.coupling import coupling_K_per_s
from hil_sim.studies.pack.settings import PackSettings
from hil_sim.studies.pack.study import WEAKEST, Row

_KINDS = ("soc", "core_K", "surface_K", "voltage_V")


def summarise(settings: PackSettings, rows: Sequence[Row]) -> dict[str, Any]:
    """Figures of each controller over all packs, and whether the claim covers what cells share."""
    names = list(rows[0]["controllers"])
    alone_s = np.array([row["slowest_alone_s"] for row in rows])
    return {
        "settings": settings.identity(),
        "settings_hash": settings.hash,
        "slowest_alone_s": _spread_of(alone_s),
        "controllers": {
            name: _controller([row["controllers"][name] for row in rows], alone_s) for name in names
        },
        "coupling": _coupling(settings, [row["controllers"][WEAKEST] for row in rows]),
    }


def claim_holds(summary: dict[str, Any]) -> bool:
    """Whether no pack with a thermistor at some or all of its cells crossed a limit, and all
    became full."""
    ours = [figures for name, figures in summary["controllers"].items() if name.startswith(WEAKEST)]
    return all(
        figures["packs_over"] == 0 and figures["packs_full"] == figures["packs"] for figures in ours
    )


def _controller(figures: Sequence[Row], alone_s: Any) -> dict[str, Any]:
    over = np.array([row["over"] for row in figures])
    cells_over = np.array([row["cells_over"] for row in figures])
    return {
        "packs": len(figures),
        "packs_over": int(np.count_nonzero(cells_over)),
        "cells_over": int(cells_over.sum()),
        "most_cells_over": int(cells_over.max()),
        "worst": dict(zip(_KINDS, map(float, over.max(axis=0)))),
        "packs_full": sum(1 for row in figures if row["outcome"] == "complete"),
        "outcomes": {
            outcome: sum(1 for row in figures if row["outcome"] == outcome)
            for outcome in sorted({row["outcome"] for row in figures})
        },
        "time_s": _spread_of(np.array([row["time_s"] for row in figures])),
        "over_slowest_alone": _spread_of(np.array([row["time_s"] for row in figures]) / alone_s),
        "fullest_soc": _spread_of(np.array([row["fullest_soc"] for row in figures])),
        "emptiest_soc": _spread_of(np.array([row["emptiest_soc"] for row in figures])),
        "stops": sum(int(row["stops"]) for row in figures),
    }


def _spread_of(values: Any) -> dict[str, float]:
    return {
        "least": float(np.min(values)),
        "median": float(np.median(values)),
        "most": float(np.max(values)),
    }


def _coupling(settings: PackSettings, figures: Sequence[Row]) -> dict[str, Any]:
    """What neighbours and coolant did to a cell at most, beside what the preset assumes of it."""
    bounds, coolant = settings.preset.uncertainty, settings.preset.sensors.coolant_temperature_K
    surface = max(row["surface_coupling_K_per_s"] for row in figures)
    along = max(row["coolant_coupling_K_per_s"] for row in figures)
    uneven = max(row["uneven_coolant_K"] for row in figures)
    reserved = (
        None
        if settings.is_family
        else coupling_K_per_s(settings.preset, settings.spread, settings.around)
    )
    return {
        "surface_K_per_s": surface,
        "preset_surface_K_per_s": bounds.surface_K_per_s,
        "preset_covers_surface": surface <= bounds.surface_K_per_s,
        "reserved_surface_K_per_s": reserved,
        "reserve_covers_surface": reserved is None or surface <= reserved,
        "coolant_K_per_s": along,
        "preset_coolant_K_per_s": bounds.coolant_K_per_s,
        "preset_covers_coolant": along <= bounds.coolant_K_per_s,
        "uneven_coolant_K": uneven,
        "coolant_reading_error_K": coolant.error_bound + BUS.coolant_temperature_K,
    }
