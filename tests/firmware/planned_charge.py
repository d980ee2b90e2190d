"""Charges of a nominal cell, of which the ECU is told how they are to be made."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from bms.presets import load_preset
from hil_sim.bus.catalog import Mode
from hil_sim.run.result import RunResult
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from tests.firmware.edited_ecu import EditedEcu


def starting_at(preset: str, temperature_K: float | None) -> Settings:
    """A charge of a shipped preset's cell, from its start or from another temperature."""
    loaded = load_preset(preset)
    initial = loaded.initial
    if temperature_K is not None:
        initial = replace(initial, temperature_K=temperature_K)
    return Settings(loaded, initial=initial, max_time_s=4000.0)


@cache
def charge(
    preset: str,
    temperature_K: float | None = None,
    mode: Mode | None = None,
    full_by_s: float | None = None,
    strongest_A: float | None = None,
) -> RunResult:
    """A whole charge by the firmware over a bus.

    `strongest_A` takes the place of the preset's reference current.
    """
    settings = replace(starting_at(preset, temperature_K), mode=mode, full_by_s=full_by_s)
    changes = {} if strongest_A is None else {"reference_current_A": strongest_A}
    return run_both(settings, ecu_factory=lambda plant, database: EditedEcu(preset, changes))


def time_s(result: RunResult) -> float:
    """Duration of a charge that has become full, with every limit kept."""
    summary = result.summary
    assert (summary.stop_reason, summary.limits_kept) == ("complete", True)
    assert summary.charge_time_s is not None
    return summary.charge_time_s
