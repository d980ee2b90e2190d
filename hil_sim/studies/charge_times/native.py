"""Charges by the campaign's C runner, which are those over the bus in a fraction of the time.

tests/hil_sim/test_campaign_agreement.py holds every period of it against the run over the bus.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bms.cell import CellState
from bms.model.model_file import load_shipped_model
from bms.presets import Preset
from hil_sim.bus.catalog import Mode
from hil_sim.plant.sensors import Readings
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.studies.campaign.engine import SUB_STEPS, CampaignCharge, Scenario
from hil_sim.studies.campaign.settings import CampaignSettings

BLOCK_PERIODS = 1000
UNDISTURBED = np.zeros(len(CellState._fields))
SEED = 0
"""That of `bms sil`, whose sensor noise it is."""


def charge_in_c(
    preset: Preset,
    controller: str,
    longest_s: float,
    *,
    mode: Mode | None = None,
    full_by_s: float | None = None,
    strongest_A: float | None = None,
    block_periods: int = BLOCK_PERIODS,
    told: Callable[[CampaignCharge], None] = lambda charge: None,
) -> CampaignCharge:
    """A shipped preset's nominal cell from its start to the end of its charge, or to longest_s.

    `strongest_A` is asked for in place of the reference; `told` sees the charge after each block.
    """
    settings = CampaignSettings(
        preset, load_shipped_model(preset.name), runs=1, max_time_s=longest_s, mode=_plain(mode)
    )
    scenario = Scenario(settings)
    if mode is not None:
        scenario.fields.mode = mode
    if full_by_s is not None:
        scenario.fields.full_by_s = full_by_s
    if strongest_A is not None:
        scenario.fields.reference_current_A = -strongest_A
    rng = np.random.default_rng(np.random.SeedSequence(SEED).spawn(3)[1])
    charge = CampaignCharge(scenario, controller, nominal_cell(preset), UNDISTURBED)
    play_undisturbed(charge, rng, block_periods=block_periods, told=told)
    return charge


def play_undisturbed(
    charge: CampaignCharge,
    rng: np.random.Generator,
    *,
    noise: float = 1.0,
    block_periods: int = BLOCK_PERIODS,
    told: Callable[[CampaignCharge], None] = lambda charge: None,
) -> None:
    """A charge without a disturbance to its end; `noise` scales that of the sensors.

    `told` sees the charge after each block.
    """
    knots = np.zeros((block_periods * SUB_STEPS, UNDISTURBED.size))
    while not charge.is_over:
        charge.advance(noise * rng.standard_normal((block_periods, len(Readings._fields))), knots)
        told(charge)


def _plain(mode: Mode | None) -> Mode | None:
    """A mode that campaigns have; one with a time is set behind them."""
    return Mode.FASTEST if mode is Mode.BY_TIME else mode
