"""Charges of a preset's nominal cell from several starts, on the firmware in C with its sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bms.calibration import NO_CHANGES
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.presets.schema import Initial
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.run.result import STOP_COMPLETE
from hil_sim.studies.campaign.engine import CampaignCharge, Scenario
from hil_sim.studies.campaign.rows import FIRMWARE
from hil_sim.studies.campaign.settings import CampaignSettings
from hil_sim.studies.charge_times.native import UNDISTURBED, play_undisturbed

SOCS = (0.01, 0.5)
COOLING_SHARES = (0.5, 1.0)
"""Of the preset's cooling power."""
LONGEST_S = 10_800.0
_INSIDE_BOX_K, _BELOW_LIMIT_K = 2.0, 10.0


@dataclass(frozen=True)
class Outcome:
    """Time to full in s, infinite where a charge did not end so, and the least distance to limits.

    Negative distances are crossed limits: core and surface in K, voltage in V, state of charge.
    """

    time_s: float
    room: tuple[float, float, float, float]

    @property
    def is_good(self) -> bool:
        """Whether the cell became full and no limit was crossed."""
        return math.isfinite(self.time_s) and min(self.room) >= 0.0


def tuning_starts(preset: Preset) -> tuple[Initial, ...]:
    """Cells at rest: cold, mild and hot; empty and half full; low and nominal cooling."""
    coldest_K = preset.operating_box.surface_temperature_K[0] + _INSIDE_BOX_K
    hottest_K = preset.limits.max_core_temperature_K - _BELOW_LIMIT_K
    return tuple(
        Initial(soc, float(temperature_K), share * preset.initial.cooling_power_W)
        for temperature_K in np.linspace(coldest_K, hottest_K, 3)
        for soc in SOCS
        for share in COOLING_SHARES
    )


def outcomes(
    preset: Preset,
    model: KanModel,
    starts: Sequence[Initial],
    seed: int = 0,
    changes: Mapping[str, float] = NO_CHANGES,
    noise: float = 1.0,
) -> list[Outcome]:
    """A charge from each start, as `bms sil` plays it; `changes` are constants of the firmware.

    The sensors' noise depends on the seed alone, and `noise` scales it. Raises what a campaign's
    scenario does.
    """
    settings = CampaignSettings(preset, model, 1, seed, LONGEST_S, changes)
    scenario = Scenario(settings)
    return [_outcome(scenario, start, seed, noise) for start in starts]


def _outcome(scenario: Scenario, start: Initial, seed: int, noise: float) -> Outcome:
    preset = scenario.preset
    charge = CampaignCharge(scenario, FIRMWARE, nominal_cell(preset, start), UNDISTURBED)
    play_undisturbed(charge, np.random.Generator(np.random.Philox(seed)), noise=noise)
    peaks, limits = charge.fields.peaks.cell, preset.limits
    return Outcome(
        float(charge.fields.time_s) if charge.outcome == STOP_COMPLETE else math.inf,
        (
            limits.max_core_temperature_K - float(peaks.core_temperature_K),
            limits.max_surface_temperature_K - float(peaks.surface_temperature_K),
            limits.max_voltage_V - float(peaks.voltage_V),
            limits.max_soc - float(peaks.soc),
        ),
    )
