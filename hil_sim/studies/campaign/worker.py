"""What a worker does with a piece of a campaign: run its charges and write a row for each run."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from typing import Any

from bms.presets import Preset
from hil_sim.bus.catalog import FirstFault
from hil_sim.plant.disturbances import knot_bounds
from hil_sim.studies.campaign.draws import Draw, draw
from hil_sim.studies.campaign.engine import (
    CONTROLLERS,
    SUB_STEPS,
    CampaignCharge,
    Scenario,
    limit_slope,
)
from hil_sim.studies.campaign.noise import knot_blocks, streams
from hil_sim.studies.campaign.settings import CampaignSettings

BLOCK_PERIODS = 1000
FIRMWARE = "kan-rcbf"

Row = dict[str, Any]


def run_chunk(settings: CampaignSettings, runs: Iterable[int]) -> str:
    """CSV lines of some runs, without the header; depends on settings and run numbers only."""
    scenario = Scenario(settings)
    text = io.StringIO()
    writer = csv.DictWriter(text, columns(), lineterminator="\n")
    writer.writerows(run_one(scenario, settings, run) for run in runs)
    return text.getvalue()


def header() -> str:
    """First line of runs.csv: the names of its columns."""
    return ",".join(columns()) + "\n"


def columns() -> list[str]:
    """Names of the columns of runs.csv; values of a controller have its name in front."""
    per_charge = (
        "outcome",
        "charge_time_s",
        "max_core_temperature_K",
        "max_surface_temperature_K",
        "max_voltage_V",
        "max_soc",
        "final_soc",
    )
    return [
        "run",
        "family",
        "core_resistance_K_per_W",
        "core_heat_capacity_J_per_K",
        "surface_resistance_K_per_W",
        "soc",
        "temperature_K",
        "cooling_power_W",
        "disturbance",
        "disturbance_share",
        *(f"{prefix(name)}_{column}" for name in CONTROLLERS for column in per_charge),
        "first_fault",
        "infeasible_periods",
        "max_estimate_error_K",
        "core_model_error_K_per_s",
        "surface_model_error_K_per_s",
        "coolant_model_error_K_per_s",
        "surface_model_error_slope_K_per_s2",
        "inside",
    ]


def prefix(controller: str) -> str:
    """Controller's name as it begins a column's name."""
    return controller.replace("-", "_")


def run_one(scenario: Scenario, settings: CampaignSettings, run: int) -> Row:
    """All controllers on the same cell, disturbance and sensor noise."""
    preset = settings.preset
    numbers = streams(settings.seed, run)
    drawn = draw(preset, run, numbers.draw)
    step_s = preset.timing.sampling_period_s / SUB_STEPS
    longest_s = settings.max_time_s + 60.0
    blocks = knot_blocks(
        drawn.disturbance,
        knot_bounds(preset),
        drawn.disturbance_share,
        step_s,
        longest_s,
        numbers.disturbance,
    )
    slope_K_per_s2 = drawn.disturbance_share * preset.uncertainty.surface_rate_K_per_s2
    first = blocks(1)
    limit_slope(first, 0.0, slope_K_per_s2 * step_s)
    true_cell = drawn.true_cell(preset)
    charges = {
        name: CampaignCharge(scenario, name, true_cell, first[0], name == FIRMWARE)
        for name in CONTROLLERS
    }
    surface_before = float(first[0, 2])
    while not all(charge.is_over for charge in charges.values()):
        normals = numbers.sensors.standard_normal((BLOCK_PERIODS, 5))
        knots = blocks(BLOCK_PERIODS * SUB_STEPS)
        limit_slope(knots, surface_before, slope_K_per_s2 * step_s)
        surface_before = float(knots[-1, 2])
        for charge in charges.values():
            charge.advance(normals, knots)
    return _row(preset, run, drawn, charges)


def _row(preset: Preset, run: int, drawn: Draw, charges: dict[str, CampaignCharge]) -> Row:
    row: Row = {
        "run": run,
        "family": drawn.family.value,
        "core_resistance_K_per_W": drawn.cell.core_resistance_K_per_W,
        "core_heat_capacity_J_per_K": drawn.cell.core_heat_capacity_J_per_K,
        "surface_resistance_K_per_W": drawn.cell.surface_resistance_K_per_W,
        "soc": drawn.soc,
        "temperature_K": drawn.temperature_K,
        "cooling_power_W": drawn.cooling_power_W,
        "disturbance": drawn.disturbance.value,
        "disturbance_share": drawn.disturbance_share,
    }
    for name, charge in charges.items():
        peaks = charge.fields.peaks
        values = {
            "outcome": charge.outcome,
            "charge_time_s": charge.fields.time_s if charge.outcome == "complete" else "",
            "max_core_temperature_K": peaks.core_temperature_K,
            "max_surface_temperature_K": peaks.surface_temperature_K,
            "max_voltage_V": peaks.voltage_V,
            "max_soc": peaks.soc,
            "final_soc": charge.fields.memory.state.soc,
        }
        row |= {f"{prefix(name)}_{key}": value for key, value in values.items()}
    fields = charges[FIRMWARE].fields
    error = fields.peaks.model_error
    slope_K_per_s2 = fields.peaks.surface_error_slope_K_per_s2
    bounds = preset.uncertainty
    inside = (
        error.soc <= bounds.soc_per_s
        and error.core <= bounds.core_K_per_s
        and error.surface <= bounds.surface_K_per_s
        and error.coolant <= bounds.coolant_K_per_s
        and slope_K_per_s2 <= bounds.surface_rate_K_per_s2
    )
    return row | {
        "first_fault": "" if fields.first_fault == FirstFault.NONE else fields.first_fault,
        "infeasible_periods": fields.infeasible_periods,
        "max_estimate_error_K": fields.peaks.estimate_error_K,
        "core_model_error_K_per_s": error.core,
        "surface_model_error_K_per_s": error.surface,
        "coolant_model_error_K_per_s": error.coolant,
        "surface_model_error_slope_K_per_s2": slope_K_per_s2,
        "inside": int(inside),
    }
