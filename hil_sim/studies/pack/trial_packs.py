"""A few packs charged under a pack's constants, for what its certificate says of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bms.cell import CellFactors, CellState, Disturbance, scaled
from bms.presets import Preset
from hil_sim.studies.pack._pack import lib
from hil_sim.studies.pack.engine import Core, PackCharge, View, peak_limits
from hil_sim.studies.pack.spread import PackDraw, Spread, Surroundings, draw_pack

DRAWN = 2
"""Packs of cells anywhere in the spread, beside the one of its ends."""
_LOOK_PERIODS = 10
_MAX_TIME_S = 7200.0


@dataclass(frozen=True)
class Trials:
    """What the packs did: cells over a limit, the strongest coupling, and the least by which the
    bound on the surface of a cell without thermistor was above it; None where each has one."""

    packs: int
    cells_over: int
    not_full: int
    coupling_K_per_s: float
    bare_surface_K: float | None


def charge_trials(
    core: Core, spread: Spread, around: Surroundings, view: View, cells: int
) -> Trials:
    """Charge packs to their ends, with the sensors' noise and the preset's disturbances."""
    preset, seen = core.preset, []
    for number, pack in enumerate(_packs(preset, spread, cells)):
        charge = PackCharge(core, pack, around, view, _MAX_TIME_S)
        seen.append(_charged(charge, preset, cells, view, np.random.default_rng(number)))
    return Trials(
        packs=len(seen),
        cells_over=sum(one.cells_over for one in seen),
        not_full=sum(one.not_full for one in seen),
        coupling_K_per_s=max(one.coupling_K_per_s for one in seen),
        bare_surface_K=min(
            (one.bare_surface_K for one in seen if one.bare_surface_K is not None), default=None
        ),
    )


def _packs(preset: Preset, spread: Spread, cells: int) -> Iterator[PackDraw]:
    rng = np.random.default_rng(0)
    for _ in range(DRAWN):
        yield draw_pack(preset, spread, cells, rng)
    yield _hot_beside_cold(preset, spread, cells)


def _hot_beside_cold(preset: Preset, spread: Spread, cells: int) -> PackDraw:
    """Cells that heat most and least in turn: those between which most heat flows."""
    bounds, start = preset.uncertainty, preset.initial
    cold_cell = CellFactors(
        core_resistance=spread.core_resistance[1],
        core_heat_capacity=spread.core_heat_capacity[1],
        surface_resistance=spread.surface_resistance[0],
        resistance=spread.resistance[0],
    )
    hot_cell = replace(
        cold_cell,
        core_heat_capacity=spread.core_heat_capacity[0],
        surface_resistance=spread.surface_resistance[1],
        resistance=spread.resistance[1],
    )
    state = CellState(start.soc, *[start.temperature_K] * 3)
    rate = Disturbance(0.0, bounds.core_K_per_s, bounds.surface_K_per_s, 0.0)
    kinds = [hot_cell if i % 2 else cold_cell for i in range(cells)]
    rates = [rate if i % 2 else Disturbance(*(-part for part in rate)) for i in range(cells)]
    return PackDraw(
        tuple(scaled(preset.cell, factors) for factors in kinds), (state,) * cells, tuple(rates)
    )


def _charged(
    charge: PackCharge, preset: Preset, cells: int, view: View, rng: np.random.Generator
) -> Trials:
    fields = charge.fields
    bare = [i for i in range(cells) if i not in view.thermistors]
    above_K: list[float] | None = [] if bare else None
    width = 2 * cells + lib.PACK_SHARED_NORMALS
    while not charge.is_over:
        # The bound is of the readings of a period, the truth of its end.
        before_K = [fields.plant.cell[i].memory.state.surface for i in bare]
        charge.advance(rng.standard_normal((1, width)))
        if above_K is not None and fields.periods > 1:
            bounds_K = [fields.pack.cell[i].surface_temperature_K for i in bare]
            above_K.append(min(b - t for b, t in zip(bounds_K, before_K)))
        charge.advance(rng.standard_normal((_LOOK_PERIODS - 1, width)))
    peaks = charge.peaks()
    return Trials(
        packs=1,
        cells_over=int((peaks > peak_limits(preset)).any(axis=1).sum()),
        not_full=int(charge.outcome != "complete"),
        coupling_K_per_s=float(fields.plant.most_surface_K_per_s),
        bare_surface_K=min(above_K) if above_K else None,
    )
