"""Cells drawn from a preset's family, each beside the bound of its own.

A cell of the campaign is at rest here, at one temperature and without a disturbance or a
thermostat, so that the bound speaks of the same charge. All else is as drawn: its parameters, the
state of charge that it has and the one that the charger tells, biases of the sensors, tolerance and
lag of the charger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from statistics import median
from typing import Any

from bms.cell import CellState, at_rest_V
from bms.model.pair import load_pair
from bms.presets import Preset
from bms.studies.optimum.answer import stated_s
from bms.studies.optimum.bound import lower_bound
from bms.studies.optimum.charge import Charge, charge_of
from hil_sim.bus.catalog import Mode
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.plant.true_cell import TrueCell
from hil_sim.run.result import STOP_COMPLETE
from hil_sim.studies.campaign.engine import CampaignCharge, Scenario
from hil_sim.studies.campaign.noise import streams
from hil_sim.studies.campaign.real_draws import RealDraw, draw_real
from hil_sim.studies.campaign.real_summary import OVERFILLED_SOC
from hil_sim.studies.campaign.rows import FIRMWARE
from hil_sim.studies.campaign.settings import CampaignSettings, CellFamily, default_max_time_s
from hil_sim.studies.campaign.worker import play
from hil_sim.studies.charge_times.prediction import Listener

PRESET = "a123_26650_10C"
SAMPLES = 60
"""Of the bound: fewer than `bms optimum` takes, so that it is somewhat lower."""
ABOVE_BOX_K = 10.0
MEDIAN_OVER_BOUND = 1.2
"""Of the time when a cell is full over physics' bound on just that."""
TIMES, BOUNDS = ("full_after_s", "charge_time_s"), ("optimum_time_s", "bound_s")
"""Of a charge: the cell is full, the firmware says so; and by physics alone, with ramp and map."""
FAMILY_ERROR = 0.20
"""Largest error of the predicted time over that of the charge, from the second minute on.

Over what is left it would have no sense for a cell whose state of charge is known to 5 % only.
"""


@dataclass(frozen=True)
class FamilyCharge:
    """The planned charge of a drawn cell; `full_after_s` is when it truly was full.

    The firmware says so later, after `charge_time_s`, once the voltage proves it; `worst_error` is
    that of its prediction, over that time; None where it was full within a minute. `optimum_time_s`
    is the bound by physics alone, `bound_s` the one with the preset's ramp and map.
    """

    run: int
    temperature_K: float
    soc: float
    optimum_time_s: float
    bound_s: float
    charge_time_s: float | None
    full_after_s: float | None
    stop_reason: str
    crossed: tuple[str, ...]
    worst_error: float | None


def charge_family(run: int, seed: int = 0, preset_name: str = PRESET) -> FamilyCharge:
    """The cell of a campaign's run. Raises InputError without cvxpy or a family."""
    preset, model = load_pair(preset_name, None)
    settings = CampaignSettings(
        preset,
        model,
        runs=run + 1,
        seed=seed,
        max_time_s=default_max_time_s(preset, CellFamily.REAL),
        family=CellFamily.REAL,
        mode=Mode.FASTEST,
    )
    numbers = streams(seed, run)
    drawn = draw_real(preset, settings.max_time_s, numbers.draw)
    cell = at_rest(preset, drawn.cell)
    quiet = RealDraw(drawn.factors, cell, DisturbanceKind.GAUSSIAN, disturbance_share=0.0)
    listener, full = Listener(), _FullWatch(preset.limits.completion_soc)

    def told(charge: CampaignCharge) -> None:
        listener(charge)
        full(charge)

    charges = play(
        Scenario(settings), settings, quiet, numbers, (FIRMWARE,), block_periods=1, told=told
    )
    charge = charges[FIRMWARE]
    time_s = float(charge.fields.time_s) if charge.outcome == STOP_COMPLETE else None
    bounded = bounded_charge(preset, cell)
    return FamilyCharge(
        run=run,
        temperature_K=cell.state.core_temperature_K,
        soc=cell.state.soc,
        optimum_time_s=stated_s(lower_bound(bounded.physics_alone(), SAMPLES)),
        bound_s=stated_s(lower_bound(bounded, SAMPLES)),
        charge_time_s=time_s,
        full_after_s=full.after_s,
        stop_reason=charge.outcome,
        crossed=_crossed(preset, charge),
        worst_error=None if time_s is None else listener.worst_share(time_s),
    )


def at_rest(preset: Preset, cell: TrueCell) -> TrueCell:
    """A drawn cell at the temperature of its surface, without polarisation and thermostat.

    Without one the coolant would get colder than the preset admits; so the cooler is no stronger
    than the nominal one, and the cell at least ABOVE_BOX_K warmer than the coldest coolant.
    """
    soc, _, surface_K, _ = cell.state
    start_K = max(surface_K, preset.operating_box.coolant_temperature_K[0] + ABOVE_BOX_K)
    return replace(
        cell,
        state=CellState(soc, start_K, start_K, start_K),
        cooling_power_W=min(cell.cooling_power_W, preset.initial.cooling_power_W),
        polarisation_V=at_rest_V(cell.cell),
        coolant_floor_K=0.0,
    )


def bounded_charge(preset: Preset, cell: TrueCell) -> Charge:
    """Of this cell, whose charger gives more than it is asked for, or less."""
    limits, gain = preset.limits, 1.0 + cell.supply_tolerance
    return replace(
        charge_of(preset),
        cell=cell.cell,
        limits=replace(limits, reference_current_A=gain * limits.reference_current_A),
        growth_A_per_s=gain * limits.current_growth_A_per_s,
        start_soc=cell.state.soc,
        start_K=cell.state.core_temperature_K,
        cooling_W=cell.cooling_power_W,
    )


class _FullWatch:
    """When the true state of charge comes to that of a full cell."""

    def __init__(self, full_soc: float) -> None:
        self._full_soc = full_soc
        self.after_s: float | None = None

    def __call__(self, charge: CampaignCharge) -> None:
        fields = charge.fields
        if self.after_s is None and fields.memory.state.soc >= self._full_soc:
            self.after_s = float(fields.time_s)


def _crossed(preset: Preset, charge: CampaignCharge) -> tuple[str, ...]:
    limits, peaks = preset.limits, charge.fields.peaks.cell
    overs = {
        "core": peaks.core_temperature_K - limits.max_core_temperature_K,
        "surface": peaks.surface_temperature_K - limits.max_surface_temperature_K,
        "voltage": peaks.voltage_V - limits.max_voltage_V,
        "soc": peaks.soc - OVERFILLED_SOC,
    }
    return tuple(name for name, over in overs.items() if over > 0.0)


def family_json(rows: Sequence[FamilyCharge]) -> dict[str, Any]:
    """Plain mapping of everything, with `passed`; a cell that did not become full is infinite."""
    content: dict[str, Any] = {"preset": PRESET, "cells": len(rows)}
    for time, bound in product(TIMES, BOUNDS):
        ratios = [(getattr(row, time) or float("inf")) / getattr(row, bound) for row in rows]
        content[f"{time}_over_{bound}"] = {
            "median": _finite(median(ratios)),
            "worst": _finite(max(ratios)),
        }
    errors = [row.worst_error for row in rows]
    near = sum(error is None or error <= FAMILY_ERROR for error in errors)
    unsafe = sum(bool(row.crossed) or row.stop_reason != STOP_COMPLETE for row in rows)
    content |= {
        "unsafe": unsafe,
        "came_true": near,
        "worst_error": round(max((e for e in errors if e is not None), default=0.0), 4),
        "charges": [asdict(row) for row in rows],
    }
    middle = content["full_after_s_over_optimum_time_s"]["median"]
    is_fast = middle is not None and middle <= MEDIAN_OVER_BOUND
    return content | {"passed": unsafe == 0 and near == len(rows) and is_fast}


def _finite(value: float) -> float | None:
    return round(value, 4) if value < float("inf") else None
