"""What one wrong sensor can do to a cell of the family before anything contradicts it.

A reading that some cell of the family could give is believed. For each sensor the worst of such
lies is worked out in the steady state in which the limits are ridden, where it does most: it is
what the user has to exclude by other means (docs/family.md, assumptions of use).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.barrier.family import extremes, family_of, polarisation_ohm
from bms.presets import Preset

_POINTS = 200


@dataclass(frozen=True)
class Lie:
    """A wrong reading that stays plausible: by how much, and what is exceeded by it."""

    sensor: str
    lie: float
    unit: str
    core_excess_K: float
    voltage_excess_V: float
    why: str


def worst_lies(preset: Preset, block: Any) -> Iterator[Lie]:
    """The worst lie of each sensor within the plausibility of the block's constants."""
    yield _voltage(preset, block)
    yield _surface(preset, block)
    yield _current(preset, block)


def _voltage(preset: Preset, block: Any) -> Lie:
    """Read low by all that the greatest resistance has above the least: heat is underrated.

    Up to where the surface would say so itself: the core as it is at most, for the surface at which
    the least core that it admits is at the limit.
    """
    cell, interval = preset.cell, family_of(preset)
    k, deviation_V = block.family, block.plausibility.voltage_deviation_V
    strength_A = np.linspace(0.1, -preset.limits.reference_current_A, _POINTS)
    greatest_ohm = float(min(k.resistance_ohm)) + polarisation_ohm(cell, interval)
    spread_V = interval.ocv_error_V + deviation_V
    lie_V = strength_A * (greatest_ohm - k.least_resistance_ohm) + spread_V
    lie_V = np.minimum(lie_V, strength_A * greatest_ohm + spread_V)
    unseen_W = np.minimum(strength_A * lie_V, strength_A**2 * greatest_ohm)
    ends, start_K = extremes(cell, interval), preset.initial.temperature_K
    most = ends.core_resistance[1] / ends.surface_resistance[0]
    least = ends.core_resistance[0] / ends.surface_resistance[1]
    gap_K = (preset.limits.max_core_temperature_K - start_K) / (1.0 + least)
    seen_K = (most - least) * gap_K + k.charge_error_K
    core_K = np.minimum(ends.core_resistance[1] * unseen_W, seen_K)
    worst = int(np.argmax(core_K))
    return Lie(
        "voltage_V",
        -float(lie_V[worst]),
        "V",
        float(core_K[worst]),
        float(lie_V[worst]),
        "an old cell that reads as a new one",
    )


def _surface(preset: Preset, block: Any) -> Lie:
    """Read cold by what the least surface resistance hides: the outflow is overrated."""
    k, ends = block.family, extremes(preset.cell, family_of(preset))
    # The whole way from the coolant to the core's limit, of which the surface takes its part.
    room_K = preset.limits.max_core_temperature_K - preset.initial.temperature_K
    heat_W = room_K / (ends.core_resistance[0] + ends.surface_resistance[1])
    strength_A = min(np.sqrt(heat_W / min(k.resistance_ohm)), -preset.limits.reference_current_A)
    least_W = max(
        0.0,
        strength_A
        * (
            block.thermal.ohmic_resistance_ohm * strength_A
            + block.thermal.entropic_coefficient_V_per_K * preset.limits.max_core_temperature_K
        ),
    )
    deficit_K = (
        ends.surface_resistance[1] * heat_W
        - ends.surface_resistance[0] * least_W
        + block.plausibility.surface_deficit_K
        + block.thermal.error_bound_K
    )
    return Lie(
        "surface_temperature_K",
        -float(deficit_K),
        "K",
        float(deficit_K),
        0.0,
        "a surface that could be so cold where its resistance to the coolant is least",
    )


def _current(preset: Preset, block: Any) -> Lie:
    """Read low by what tolerance and lag of the charger explain."""
    strength_A = -preset.limits.reference_current_A
    lie_A = 2.0 * preset.supply.tolerance * strength_A + block.plausibility.current_deviation_A
    k = block.family
    heat_W = 2.0 * strength_A * lie_A * float(min(k.resistance_ohm))
    core_K = extremes(preset.cell, family_of(preset)).core_resistance[1] * heat_W
    return Lie(
        "current_A",
        float(lie_A),
        "A",
        float(core_K),
        float(lie_A * min(k.resistance_ohm)),
        "a charger that gives less than it is told",
    )
