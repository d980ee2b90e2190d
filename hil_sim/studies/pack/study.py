"""Packs charged by what sees every cell, fewer thermistors, one cell, or the mean."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any

import numpy as np

from hil_sim.run.workforce import Workforce
from hil_sim.studies.pack.engine import (
    Core,
    PackCharge,
    View,
    all_cells,
    mean_of_all,
    one_cell,
    peak_limits,
    play,
)
from hil_sim.studies.pack.reserves import Reserves, reserves
from hil_sim.studies.pack.settings import PackSettings
from hil_sim.studies.pack.spread import PackDraw, draw_pack

WEAKEST = "weakest"
"""Every cell's own interval, with a thermistor at each."""
GROUPS = (2, 4, 8)
"""Cells for each thermistor, beside one."""
ONE_CELL, MEAN = "one cell", "mean"
WITHOUT_RESERVES = "no reserves"
Row = dict[str, Any]


def group_name(cells: int) -> str:
    """Controller with a thermistor for so many cells."""
    return f"{WEAKEST}, 1 per {cells}"


def controllers(
    settings: PackSettings, core: Core, bare_core: Core
) -> dict[str, tuple[Core, View]]:
    """What each controller goes by and sees; a family has reserves in its intervals."""
    cells = settings.cells
    views: dict[str, tuple[Core, View]] = {WEAKEST: (core, all_cells(cells))}
    if not settings.is_family:
        views |= {group_name(g): (core, all_cells(cells, g)) for g in GROUPS if g <= cells}
        views[WITHOUT_RESERVES] = (bare_core, all_cells(cells))
    return views | {ONE_CELL: (core, one_cell(0)), MEAN: (core, mean_of_all(cells))}


def run_packs(settings: PackSettings, packs: Iterable[int]) -> list[Row]:
    """Rows of some packs; depend on settings and pack numbers only."""
    kept = reserves(settings.preset, settings.spread, settings.around)
    core = Core(settings.preset, settings.model, kept)
    plain = Core(settings.preset, settings.model, Reserves({}, kept.bare, kept.deficit_K))
    views = controllers(settings, core, plain)
    return [_run_pack(settings, core, views, pack) for pack in packs]


def run_study(
    settings: PackSettings, workforce: Workforce, progress: Callable[[int], None]
) -> list[Row]:
    """Rows of all packs in their order."""
    waiting = iter(settings.chunks())
    pending: set[Future[list[Row]]] = set()
    rows: list[Row] = []
    while True:
        while len(pending) < workforce.pieces_at_hand and (chunk := next(waiting, None)):
            pending.add(workforce.executor.submit(run_packs, settings, chunk))
        if not pending:
            return sorted(rows, key=lambda row: int(row["pack"]))
        finished, pending = wait(pending, return_when=FIRST_COMPLETED)
        for future in finished:
            done = future.result()
            rows += done
            progress(len(done))


def _run_pack(
    settings: PackSettings, core: Core, views: dict[str, tuple[Core, View]], pack: int
) -> Row:
    children = np.random.SeedSequence(entropy=settings.seed, spawn_key=(pack,)).spawn(3)
    draws, noise, alone = (np.random.Generator(np.random.Philox(child)) for child in children)
    drawn = draw_pack(settings.preset, settings.spread, settings.cells, draws, settings.disturbed)
    charges = {
        name: PackCharge(own_core, drawn, settings.around, view, settings.max_time_s)
        for name, (own_core, view) in views.items()
    }
    play(list(charges.values()), settings.cells, noise)
    return {
        "pack": pack,
        "slowest_alone_s": _slowest_alone_s(settings, core, drawn, alone),
        "controllers": {name: _figures(settings, charge) for name, charge in charges.items()},
    }


def _slowest_alone_s(
    settings: PackSettings, core: Core, drawn: PackDraw, rng: np.random.Generator
) -> float:
    """Time of the cell that takes longest when each is charged by itself."""
    slowest_s = 0.0
    for cell, state, disturbance in zip(drawn.cells, drawn.states, drawn.disturbances):
        single = PackDraw((cell,), (state,), (disturbance,))
        charge = PackCharge(core, single, settings.around, one_cell(0), settings.max_time_s)
        play([charge], 1, rng)
        slowest_s = max(slowest_s, float(charge.fields.time_s))
    return slowest_s


def _figures(settings: PackSettings, charge: PackCharge) -> Row:
    peaks = charge.peaks()
    over = peaks - peak_limits(settings.preset)
    fields = charge.fields
    return {
        "outcome": charge.outcome,
        "time_s": round(float(fields.time_s), 3),
        "cells_over": int(np.count_nonzero((over > 0.0).any(axis=1))),
        "over": [float(value) for value in over.max(axis=0)],
        "fullest_soc": float(peaks[:, 0].max()),
        "emptiest_soc": float(peaks[:, 0].min()),
        "stops": int(fields.stops),
        "governing_cells": sum(1 for i in range(settings.cells) if fields.governed[i]),
        "surface_coupling_K_per_s": float(fields.plant.most_surface_K_per_s),
        "coolant_coupling_K_per_s": float(fields.plant.most_coolant_K_per_s),
        "uneven_coolant_K": float(fields.plant.most_uneven_K),
    }
