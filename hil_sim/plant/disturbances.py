"""Process disturbances within the bounds of a preset, as knots at the plant's sub-steps.

A source yields the disturbance at the end of each sub-step; between two knots it runs linearly.
Every source stays within the preset's bounds, with the core's at the reference current, from which
the plant scales it to that of the present one. The surface disturbance starts from zero and changes
by no more than its slope bound allows.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from enum import Enum

import numpy as np

from bms.cell import Disturbance
from bms.presets import Preset
from bms.presets.schema import Uncertainty

Source = Iterator[Disturbance]


class DisturbanceKind(str, Enum):
    """The kinds of disturbance, by their names on the command line."""

    NONE = "none"
    GAUSSIAN = "gaussian"
    BANG_BANG = "bang-bang"
    UPWARD = "upward"


SHORTEST_DWELL_S, LONGEST_DWELL_S = 0.01, 100.0
_BLOCK = 1000


def disturbance_source(
    kind: DisturbanceKind, preset: Preset, step_s: float, rng: np.random.Generator
) -> Source:
    """Endless source of knots step_s apart.

    gaussian: white noise with the bound as its standard deviation, cut at the bound (paper,
    simulation setup). bang-bang: each rate jumps between its two bounds after random times from
    10 ms to 100 s. upward: every rate at the bound that heats and charges the cell.
    """
    if kind is DisturbanceKind.NONE:
        return itertools.repeat(Disturbance())
    bounds = knot_bounds(preset)
    wanted: dict[DisturbanceKind, Callable[[], Iterator[list[float]]]] = {
        DisturbanceKind.GAUSSIAN: lambda: _gaussian(bounds, rng),
        DisturbanceKind.BANG_BANG: lambda: _bang_bang(bounds, step_s, rng),
        DisturbanceKind.UPWARD: lambda: itertools.repeat(list(bounds)),
    }
    return _slope_limited(wanted[kind](), preset.uncertainty.surface_rate_K_per_s2 * step_s)


def knot_bounds(preset: Preset) -> Disturbance:
    """Bounds of the knots of every source; that of the core is the one at the reference current."""
    bounds = preset.uncertainty
    return Disturbance(
        bounds.soc_per_s,
        bounds.core_at_K_per_s(preset.limits.reference_current_A),
        bounds.surface_K_per_s,
        bounds.coolant_K_per_s,
    )


def core_growth(bounds: Uncertainty, current_A: float, reference_current_A: float) -> float:
    """Factor on a knot's core at a current: its bound there over that at the reference current."""
    at_reference = bounds.core_at_K_per_s(reference_current_A)
    if at_reference == bounds.core_K_per_s:
        return 1.0
    return float(bounds.core_at_K_per_s(current_A) / at_reference)


def _gaussian(bounds: Disturbance, rng: np.random.Generator) -> Iterator[list[float]]:
    while True:
        noise = np.clip(rng.standard_normal((_BLOCK, len(bounds))), -1.0, 1.0)
        yield from (noise * np.asarray(bounds)).tolist()


def _bang_bang(
    bounds: Disturbance, step_s: float, rng: np.random.Generator
) -> Iterator[list[float]]:
    signs = rng.choice([-1.0, 1.0], size=len(bounds))
    steps_left = np.zeros(len(bounds), dtype=np.int64)
    low, high = np.log([SHORTEST_DWELL_S, LONGEST_DWELL_S])
    while True:
        over = steps_left <= 0
        if np.any(over):
            dwell_s = np.exp(rng.uniform(low, high, size=len(bounds)))
            signs = np.where(over, -signs, signs)
            steps_left = np.where(over, np.maximum(dwell_s / step_s, 1).astype(int), steps_left)
        knot = (signs * np.asarray(bounds)).tolist()
        held = int(steps_left.min())
        steps_left = steps_left - held
        yield from itertools.repeat(knot, held)


def _slope_limited(wanted: Iterator[list[float]], largest_change_K_per_s: float) -> Source:
    surface = 0.0
    for soc, core, target, coolant in wanted:
        change = target - surface
        surface += min(max(change, -largest_change_K_per_s), largest_change_K_per_s)
        yield Disturbance(soc, core, surface, coolant)
