"""Charging profiles that training and test data are simulated from.

Every profile begins at thermal rest (core, surface and coolant at one temperature), as a charge
does, with a current step at its first sample, and keeps one cooling power. Constant profiles last
until the cell is full or leaves the operating box, at most an hour; dynamic ones at most 20
minutes. Profiles of steps, for the error bound only, jump between no current and the strongest one.
Samples are 1 s apart. Temperatures, cooling powers and constant currents are spread evenly
over the box by Latin hypercubes. The start counts in every error figure: the estimate is about one
fast thermal mode (5 s) ahead there, and no map of the four inputs at one instant can know it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from bms.arrays import Array
from bms.presets import Preset

Kind = Literal["constant", "dynamic", "steps"]
KINDS: tuple[Kind, ...] = ("constant", "dynamic")
"""Kinds that networks are trained and tested on."""

SAMPLE_PERIOD_S = 1.0
_DURATION_S = {"constant": 3600.0, "dynamic": 1200.0, "steps": 1200.0}
_COLDEST_START_ABOVE_BOX_K = 2.0
_WARMEST_START_BELOW_BOX_K = 13.0
MAX_INITIAL_SOC = 0.2
_SHARE_OF_RESTS = 0.2
_SHARE_OF_STEPS = 0.25
_HOLD_S = (30.0, 300.0)
_RAMP_A_PER_S = (0.05, 1.0)
CORE_LIMIT_BELOW_BOX_K = (1.0, 25.0)


@dataclass(frozen=True)
class Profiles:
    """Profiles of one kind: wanted current (P, S) in A, the other arrays of shape (P,).

    While the core comes near `core_limit_K` the current is derated (infinite: never).
    """

    kind: Kind
    wanted_current_A: Array
    cooling_power_W: Array
    initial_temperature_K: Array
    initial_soc: Array
    core_limit_K: Array


def draw_profiles(preset: Preset, kind: Kind, count: int, rng: np.random.Generator) -> Profiles:
    """Random profiles over the preset's operating box.

    Constant: one current from rest, all magnitudes alike. Dynamic: levels held for 30 s to 300 s,
    a fifth of them rests, joined by ramps of 0.05 to 1 A/s and, one in four, by steps; derated as
    a barrier controller does when the core reaches a limit that differs from profile to profile.
    Steps: 0 A and the reference current in turn, each held for 30 s to 300 s.
    """
    box = preset.operating_box
    shares = _latin_hypercube(count, 5, rng)
    low_K, high_K = start_range_K(preset)
    steps = round(_DURATION_S[kind] / SAMPLE_PERIOD_S)
    if kind == "constant":
        current_A = np.repeat(_between(shares[:, :1], *box.current_A), steps, axis=1)
        core_limit_K = np.full(count, np.inf)
    elif kind == "steps":
        strongest_A = preset.limits.reference_current_A
        current_A = np.stack([_jumping_current_A(strongest_A, steps, rng) for _ in shares])
        core_limit_K = np.full(count, np.inf)
    else:
        current_A = np.stack([_wandering_current_A(box.current_A, steps, rng) for _ in shares])
        near_K, far_K = CORE_LIMIT_BELOW_BOX_K
        core_limit_K = box.surface_temperature_K[1] - _between(shares[:, 4], near_K, far_K)
    return Profiles(
        kind,
        current_A,
        _between(shares[:, 1], *box.cooling_power_W),
        _between(shares[:, 2], low_K, high_K),
        _between(shares[:, 3], 0.0, MAX_INITIAL_SOC),
        core_limit_K,
    )


def joined_profiles(sets: Sequence[Profiles]) -> Profiles:
    """Profiles of one kind and length, all in one."""
    first = sets[0]
    columns = [field.name for field in fields(Profiles) if field.name != "kind"]
    arrays = {name: np.concatenate([getattr(one, name) for one in sets]) for name in columns}
    return Profiles(first.kind, **arrays)


def start_range_K(preset: Preset) -> tuple[float, float]:
    """Temperatures from which profiles begin, well within the box."""
    low_K, high_K = preset.operating_box.surface_temperature_K
    return low_K + _COLDEST_START_ABOVE_BOX_K, high_K - _WARMEST_START_BELOW_BOX_K


def _wandering_current_A(
    limits_A: tuple[float, float], steps: int, rng: np.random.Generator
) -> Array:
    """Levels, ramps, steps and rests, one value for each sample."""
    times_s, currents_A = [0.0], [_level_A(limits_A, rng)]
    while times_s[-1] < steps * SAMPLE_PERIOD_S:
        held_until_s = times_s[-1] + rng.uniform(*_HOLD_S)
        level_A = _level_A(limits_A, rng)
        change_A = abs(level_A - currents_A[-1])
        is_step = rng.random() < _SHARE_OF_STEPS
        rate_A_per_s = np.exp(rng.uniform(*np.log(_RAMP_A_PER_S)))
        ramp_s = SAMPLE_PERIOD_S if is_step else change_A / rate_A_per_s
        times_s += [held_until_s, held_until_s + ramp_s]
        currents_A += [currents_A[-1], level_A]
    sampled_A: Array = np.interp(np.arange(steps) * SAMPLE_PERIOD_S, times_s, currents_A)
    return sampled_A


def _jumping_current_A(strongest_A: float, steps: int, rng: np.random.Generator) -> Array:
    """The strongest current and none in turn, one value for each sample."""
    jumps = round(steps * SAMPLE_PERIOD_S / _HOLD_S[0]) + 1
    held = np.round(rng.uniform(*_HOLD_S, jumps) / SAMPLE_PERIOD_S).astype(int)
    current_A: Array = np.repeat(strongest_A * (np.arange(jumps) % 2 == 0), held)[:steps]
    return current_A


def _level_A(limits_A: tuple[float, float], rng: np.random.Generator) -> float:
    return 0.0 if rng.random() < _SHARE_OF_RESTS else float(rng.uniform(*limits_A))


def _latin_hypercube(count: int, dimensions: int, rng: np.random.Generator) -> Array:
    strata = np.stack([rng.permutation(count) for _ in range(dimensions)], axis=1)
    return (strata + rng.random(strata.shape)) / count


def _between(share: Array, low: float, high: float) -> Array:
    return low + share * (high - low)
