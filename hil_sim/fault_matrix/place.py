"""Where the charge of a row begins for a preset, and in which period it has its fault first.

A row is about a charge that flows. So the charge is tried without the fault: where a family's core
is not known yet at the onset, the fault comes later by what the current is late, and where none
flows so near to the limit, the charge begins in steps further below it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.presets.schema import Initial
from hil_sim.bus.catalog import Mode
from hil_sim.fault_matrix.matrix import Start
from hil_sim.fault_matrix.size import strongest_A
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

_COOLER_K = 3.0
_LONGEST_WAIT_PERIODS = 600


@dataclass(frozen=True)
class Place:
    """State at plug-in, and the period of the charge that has the fault first."""

    initial: Initial
    onset: int


def find_place(preset: Preset, model: KanModel, start: Start, seed: int = 0) -> Place:
    """The start for a preset; as near to its limit as the row says where that leaves a current.

    Without any current it is where the row says, and the row finds that none flowed. Raises
    InputError or BusError.
    """
    onset = nominal_onset(preset, start)
    first = initial = nominal_initial(preset, start)
    coldest_K = min(first.temperature_K, preset.initial.temperature_K)
    while True:
        wait = _wait_periods(preset, model, initial, onset, seed)
        if wait is not None:
            return Place(initial, onset + wait)
        cooler_K = initial.temperature_K - _COOLER_K
        if start.below_limit_K is None or cooler_K < coldest_K:
            return Place(first, onset)
        initial = replace(initial, temperature_K=cooler_K)


def nominal_initial(preset: Preset, start: Start) -> Initial:
    """Where a cell of the preset would begin, whether a current flows there or not."""
    initial, limits = preset.initial, preset.limits
    temperature_K = start.temperature_K or initial.temperature_K
    if start.below_limit_K is not None:
        lower_K = min(limits.max_core_temperature_K, limits.max_surface_temperature_K)
        temperature_K = lower_K - start.below_limit_K
    soc = initial.soc if start.soc is None else start.soc
    return replace(initial, soc=soc, temperature_K=temperature_K)


def nominal_onset(preset: Preset, start: Start) -> int:
    """The fault's first period where current flows at once."""
    if start.onset_period is not None:
        return start.onset_period
    assert start.onset_current_share is not None
    onset_A = start.onset_current_share * strongest_A(preset)
    growth_s = onset_A / preset.limits.current_growth_A_per_s
    return round(growth_s / preset.timing.sampling_period_s)


def _wait_periods(
    preset: Preset, model: KanModel, initial: Initial, onset: int, seed: int
) -> int | None:
    """Periods by which the fault has to come later to find a current; None where none flows."""
    before = max(onset, 1) - 1
    if _flowing(preset, model, initial, seed, onset + 1)[before]:
        return 0
    flowing = _flowing(preset, model, initial, seed, onset + _LONGEST_WAIT_PERIODS)
    wait = flowing.index(True) if True in flowing else len(flowing)
    before += wait
    return wait if before < len(flowing) and flowing[before] else None


def _flowing(
    preset: Preset, model: KanModel, initial: Initial, seed: int, periods: int
) -> list[bool]:
    """Whether a current flows, by period of a charge without a fault."""
    settings = Settings(
        preset=preset,
        initial=initial,
        model=model,
        mode=Mode.FIXED,
        bus="virtual:place",
        seed=seed,
        max_time_s=periods * preset.timing.sampling_period_s,
        answer_timeout_s=0.0,
        ends_early=False,
    )
    series = run_both(settings).series
    return [
        current_A < 0.0
        for period, current_A in zip(series.charge_period, series.current_A)
        if period is not None
    ]
