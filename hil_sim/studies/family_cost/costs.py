"""Charges of the nominal cell by firmware that knows more and more of it.

The parts of a family are made known one after the other, so that their costs add up to the whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

from bms.cell import CellInterval
from bms.errors import InputError
from bms.model.model_file import load_shipped_model
from bms.presets import Preset
from bms.presets.schema import PlugIn
from hil_sim.run.session import run_sil
from hil_sim.run.settings import Settings

_EXACT = (1.0, 1.0)
FULL_SOC = 0.99

Change = Callable[[Preset], Preset]


def _interval(**known: object) -> Change:
    def change(preset: Preset) -> Preset:
        interval = preset.cell.interval
        assert isinstance(interval, CellInterval)
        return replace(
            preset,
            cell=replace(preset.cell, interval=replace(interval, **known)),  # type: ignore[arg-type]
        )

    return change


def _shortest_relaxation(preset: Preset) -> Preset:
    longest_s = max((b.time_constant_s for b in preset.cell.branches), default=1.0)
    return _interval(longest_relaxation_s=longest_s)(preset)


PARTS: tuple[tuple[str, Change], ...] = (
    ("resistance core to surface", _interval(core_resistance=_EXACT)),
    ("heat capacity of the core", _interval(core_heat_capacity=_EXACT)),
    (
        "surface and coolant",
        _interval(
            surface_resistance=_EXACT, surface_heat_capacity=_EXACT, coolant_heat_capacity=_EXACT
        ),
    ),
    ("ohmic resistance", _interval(resistance=_EXACT)),
    ("polarisation", _interval(polarisation=_EXACT)),
    ("relaxation", _shortest_relaxation),
    ("dU/dT", _interval(entropic_error_V_per_K=0.0)),
    ("open-circuit voltage", _interval(ocv_error_V=0.0)),
    ("capacity", _interval(capacity=_EXACT)),
    ("state at plug-in", lambda preset: replace(preset, plug_in=PlugIn())),
)


@dataclass(frozen=True)
class Cost:
    """Time to FULL_SOC (true) and to completion in s, once all parts up to this one are known."""

    known: str
    full_s: float
    complete_s: float


def family_costs(preset: Preset, temperature_K: float) -> Iterator[Cost]:
    """Charges from a temperature: the whole family first, then with one more part known each.

    Raises InputError for a preset without a family, or when a charge does not get full.
    """
    if preset.cell.interval is None:
        raise InputError(f"preset '{preset.name}': cell.interval is missing; there is no family")
    model = load_shipped_model(preset.name)
    start = replace(preset.initial, temperature_K=temperature_K)
    yield _charge("nothing", Settings(preset, model=model, initial=start))
    for name, change in PARTS:
        preset = change(preset)
        yield _charge(name, Settings(preset, model=model, initial=start))


def shares(costs: list[Cost]) -> dict[str, float]:
    """Seconds that each part costs, by name; together they are the whole difference."""
    return {after.known: before.full_s - after.full_s for before, after in pairwise(costs)}


def _charge(known: str, settings: Settings) -> Cost:
    result = run_sil(settings)
    series, complete_s = result.series, result.summary.charge_time_s
    full_s = next((t for t, soc in zip(series.time_s, series.soc) if soc >= FULL_SOC), None)
    if full_s is None or complete_s is None:
        raise InputError(f"preset '{settings.preset.name}': the charge ends before it is full")
    return Cost(known, full_s, complete_s)
