"""What tests of several plants need: charges of them, and heat balances."""

from __future__ import annotations

import itertools
from dataclasses import replace

from bms.cell import Disturbance
from bms.presets import Preset
from hil_sim.plant.seam import PlantLike


def calm() -> itertools.repeat:
    """A disturbance that is none."""
    return itertools.repeat(Disturbance())


def started(preset: Preset, soc: float, temperature_K: float = 298.15) -> Preset:
    """The preset with another start."""
    initial = replace(preset.initial, soc=soc, temperature_K=temperature_K)
    return replace(preset, initial=initial)


def held(plant: PlantLike, current_A: float, periods: int) -> None:
    """Hold a current over control periods."""
    for _ in range(periods):
        plant.current_A = current_A
        plant.advance()


def stored_heat_J(preset: Preset, plant: PlantLike) -> float:
    """Heat in core, surface and coolant, counted from the preset's start."""
    cell, start_K = preset.cell, preset.initial.temperature_K
    _, core_K, surface_K, coolant_K = plant.state
    return (
        cell.core_heat_capacity_J_per_K * (core_K - start_K)
        + cell.surface_heat_capacity_J_per_K * (surface_K - start_K)
        + cell.coolant_heat_capacity_J_per_K * (coolant_K - start_K)
    )
