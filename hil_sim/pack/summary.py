"""summary.json of a pack's charge."""

from __future__ import annotations

from typing import Any

from hil_sim.bus.catalog import FirstFault
from hil_sim.pack.charge import PackResult
from hil_sim.run.result import STOP_COMPLETE
from hil_sim.studies.pack.engine import peak_limits

KINDS = ("soc", "core_temperature_K", "surface_temperature_K", "voltage_V")


def margins(result: PackResult) -> Any:
    """What each cell left of each limit at its worst, (cells, KINDS); below 0 it was crossed."""
    return peak_limits(result.settings.preset) - result.peaks


def has_passed(result: PackResult) -> bool:
    """Whether the pack became full and no cell crossed a limit."""
    return result.reason == STOP_COMPLETE and bool((margins(result) >= 0.0).all())


def summary(result: PackResult) -> dict[str, Any]:
    """All figures as plain JSON; cells count from 1."""
    settings = result.settings
    period_s = settings.preset.timing.sampling_period_s
    left = margins(result)
    return {
        "controller": "pack",
        "preset": settings.preset.name,
        "bus": settings.bus,
        "cells": settings.cells,
        "thermistors": len(settings.view.thermistors),
        "thermistor_at": [cell + 1 for cell in settings.view.thermistors],
        "spread": settings.spread.value,
        "seed": settings.seed,
        "cell_plants": {str(cell + 1): plant for cell, plant in settings.cell_plants},
        "stop_reason": result.reason,
        "steps": result.steps,
        "frames_per_period": result.frames / result.steps,
        "charge_time_s": round(result.charge_periods * period_s, 6),
        "max_core_temperature_K": float(result.peaks[:, 1].max()),
        "max_surface_temperature_K": float(result.peaks[:, 2].max()),
        "max_voltage_V": float(result.peaks[:, 3].max()),
        "min_anode_potential_V": result.least_anode_V,
        "fullest_soc": max(result.final_socs),
        "emptiest_soc": min(result.final_socs),
        "spread_when_full": _spread(result.full_socs),
        "spread_at_end": _spread(result.final_socs),
        "counted_fullest_soc": result.counted_soc[1] if result.counted_soc else None,
        "counted_emptiest_soc": result.counted_soc[0] if result.counted_soc else None,
        "weakest_cell": max(result.governed, key=lambda c: (result.governed[c], -c), default=None),
        "governed_s": {str(c): round(n * period_s, 6) for c, n in sorted(result.governed.items())},
        "constraint_s": {
            name: round(n * period_s, 6) for name, n in sorted(result.constraints.items())
        },
        "worst_margins": [
            {"cell": i + 1, **dict(zip(KINDS, map(float, row)))} for i, row in enumerate(left)
        ],
        "cells_over": int((left < 0.0).any(axis=1).sum()),
        "first_fault": fault_name(result.first_fault),
        "faulty_cell": result.faulty_cell or None,
        "wall_time_s": result.wall_time_s,
        "times_real_time": result.steps * period_s / result.wall_time_s,
    }


def _spread(socs: list[float]) -> float | None:
    return max(socs) - min(socs) if socs else None


def fault_name(fault: int) -> str | None:
    """Name of a fault in the database; None for none."""
    return None if fault == FirstFault.NONE else FirstFault(fault).label
