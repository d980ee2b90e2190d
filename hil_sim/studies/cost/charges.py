"""Control periods of charges, as records for the counting program."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bms.arrays import Mask
from bms.presets import Preset
from hil_sim.logs.recorder import PeriodRecorder
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.result import CHARGING_STATES
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from hil_sim.studies.cost.records import period, restart

SHORT_CHARGE_S = 8.0
"""Past the growth of the current from 0 to 10C."""
_COLDEST_ABOVE_BOX_K, _HOTTEST_BELOW_LIMIT_K = 1.0, 5.0


class ChargeRecords(NamedTuple):
    """A charge from the ECU's start, in what the ECU receives."""

    records: list[bytes]
    decides: Mask
    """(N,) by period, whether the ECU decides on the current in it."""


def charge_records(settings: Settings) -> ChargeRecords:
    """Run a charge. Raises InputError or BusError."""
    sent = PeriodRecorder()
    states = run_both(settings, sent).series.state
    decides = np.array([state in CHARGING_STATES for state in states])
    return ChargeRecords([restart(), *map(period, sent.periods)], decides)


def random_charges(preset: Preset, count: int, rng: np.random.Generator) -> Iterator[bytes]:
    """Beginnings of charges from any temperature that allows one, some into the limits."""
    coldest_K = preset.operating_box.surface_temperature_K[0] + _COLDEST_ABOVE_BOX_K
    hottest_K = preset.limits.max_core_temperature_K - _HOTTEST_BELOW_LIMIT_K
    for _ in range(count):
        initial = replace(
            preset.initial,
            soc=float(rng.uniform(0.0, 0.98)),
            temperature_K=float(rng.uniform(coldest_K, hottest_K)),
        )
        settings = Settings(
            replace(preset, initial=initial),
            seed=int(rng.integers(2**31)),
            disturbance=DisturbanceKind.BANG_BANG,
            max_time_s=SHORT_CHARGE_S,
        )
        yield from charge_records(settings).records
