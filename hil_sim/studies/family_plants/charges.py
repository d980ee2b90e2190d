"""The firmware with a preset's family on electrochemical cells, new and with more resistance."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

from bms.presets import Preset
from hil_sim.run.result import STOP_COMPLETE, RunResult
from hil_sim.run.session import run_sil
from hil_sim.run.settings import Settings

TEMPERATURES_K = (285.0, 298.0, 313.0)
PLANTS = ("pybamm:spme", "pybamm:spme,contact=0.006")
LONGEST_S = 7200.0
_FLOWING_A = 0.5
"""A command beyond this that is followed by 0 A has been a stop."""


@dataclass(frozen=True)
class ChargeOfPlant:
    """One charge: what was reached, and how far from each limit it stayed (negative: below)."""

    preset: str
    plant: str
    start_K: float
    stop_reason: str
    charge_time_s: float | None
    final_soc: float
    core_over_K: float
    surface_over_K: float
    voltage_over_V: float
    stops: int
    min_anode_potential_V: float | None

    @property
    def is_safe(self) -> bool:
        """Whether no limit was crossed, and the charge was completed without a stop."""
        overs = (self.core_over_K, self.surface_over_K, self.voltage_over_V)
        return max(overs) <= 0.0 and self.stops == 0 and self.stop_reason == STOP_COMPLETE


def charges_of_plants(
    preset: Preset,
    plants: tuple[str, ...] = PLANTS,
    temperatures_K: tuple[float, ...] = TEMPERATURES_K,
) -> Iterator[ChargeOfPlant]:
    """Charges of each plant from each temperature; raises what run_sil raises."""
    for plant in plants:
        for temperature_K in temperatures_K:
            start = replace(preset.initial, temperature_K=temperature_K)
            result = run_sil(Settings(preset, plant=plant, initial=start, max_time_s=LONGEST_S))
            yield _summed_up(preset, plant, temperature_K, result)


def _summed_up(preset: Preset, plant: str, start_K: float, result: RunResult) -> ChargeOfPlant:
    summary, limits = result.summary, preset.limits
    commands = [command or 0.0 for command in result.series.command_A]
    # The last command of a complete charge is 0 A.
    before = commands[:-1] if summary.stop_reason == STOP_COMPLETE else commands
    return ChargeOfPlant(
        preset=preset.name,
        plant=plant,
        start_K=start_K,
        stop_reason=summary.stop_reason,
        charge_time_s=summary.charge_time_s,
        final_soc=summary.final_soc,
        core_over_K=summary.max_core_temperature_K - limits.max_core_temperature_K,
        surface_over_K=summary.max_surface_temperature_K - limits.max_surface_temperature_K,
        voltage_over_V=summary.max_voltage_V - limits.max_voltage_V,
        stops=sum(
            first < -_FLOWING_A and second == 0.0 for first, second in itertools.pairwise(before)
        ),
        min_anode_potential_V=summary.min_anode_potential_V,
    )
