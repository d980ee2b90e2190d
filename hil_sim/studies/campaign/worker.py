"""What a worker does with a piece of a campaign: run its charges and write a row for each run."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable

import numpy as np

from hil_sim.plant.disturbances import knot_bounds
from hil_sim.studies.campaign.draws import Draw, draw
from hil_sim.studies.campaign.engine import (
    CONTROLLERS,
    SUB_STEPS,
    CampaignCharge,
    Scenario,
    limit_slope,
)
from hil_sim.studies.campaign.noise import Streams, knot_blocks, streams
from hil_sim.studies.campaign.real_draws import RealDraw, draw_real
from hil_sim.studies.campaign.rows import FIRMWARE, Row, columns, real_row, row
from hil_sim.studies.campaign.settings import CampaignSettings, CellFamily

BLOCK_PERIODS = 1000


def run_chunk(settings: CampaignSettings, runs: Iterable[int]) -> str:
    """CSV lines of some runs, without the header; depends on settings and run numbers only."""
    scenario = Scenario(settings)
    text = io.StringIO()
    writer = csv.DictWriter(text, columns(settings.family), lineterminator="\n")
    writer.writerows(run_one(scenario, settings, run) for run in runs)
    return text.getvalue()


def run_one(scenario: Scenario, settings: CampaignSettings, run: int) -> Row:
    """All controllers on the same cell, disturbance and sensor noise."""
    preset = settings.preset
    numbers = streams(settings.seed, run)
    if settings.family is CellFamily.REAL:
        real = draw_real(preset, settings.max_time_s, numbers.draw)
        return real_row(run, real, play(scenario, settings, real, numbers))
    drawn = draw(preset, run, numbers.draw)
    return row(preset, run, drawn, play(scenario, settings, drawn, numbers))


def play(
    scenario: Scenario,
    settings: CampaignSettings,
    drawn: Draw | RealDraw,
    numbers: Streams,
    controllers: Iterable[str] = CONTROLLERS,
    block_periods: int = BLOCK_PERIODS,
    told: Callable[[CampaignCharge], None] = lambda charge: None,
) -> dict[str, CampaignCharge]:
    """Charges of a drawn cell to their ends, by controller; `told` sees each after each block."""
    preset = settings.preset
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
    largest_change_K_per_s = _slope_K_per_s2(settings, drawn) * step_s
    first = blocks(1)
    limit_slope(first, 0.0, largest_change_K_per_s)
    watched = settings.family is CellFamily.PUBLISHED
    true_cell = drawn.true_cell(preset)
    charges = {
        name: CampaignCharge(scenario, name, true_cell, first[0], watched and name == FIRMWARE)
        for name in controllers
    }
    surface_before = float(first[0, 2])
    while not all(charge.is_over for charge in charges.values()):
        normals = numbers.sensors.standard_normal((block_periods, 5))
        knots = blocks(block_periods * SUB_STEPS)
        limit_slope(knots, surface_before, largest_change_K_per_s)
        surface_before = float(knots[-1, 2])
        for charge in charges.values():
            charge.advance(normals, knots)
            told(charge)
    return charges


def _slope_K_per_s2(settings: CampaignSettings, drawn: Draw | RealDraw) -> float:
    """Bound on the slope of the surface disturbance; none where the preset assumes none."""
    preset = settings.preset
    if settings.family is CellFamily.REAL and preset.gains.surface_condition == "worst-case":
        return float(np.inf)
    return drawn.disturbance_share * preset.uncertainty.surface_rate_K_per_s2
