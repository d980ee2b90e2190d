"""Search for the states whose estimate and decision cost most."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from bms.arrays import Array
from bms.presets import Preset
from hil_sim.studies.cost.records import Counts, State, state

GENERATIONS = 4
_KEPT = 50
_STEP = 0.05
"""Of each range, standard deviation of what a generation changes."""
_BEYOND_BOX = 0.1
_CORE_ABOVE_SURFACE_K = (-2.0, 8.0)
_WEAKEST_REFERENCE_A = 0.0


def search_states(
    preset: Preset,
    states: int,
    rng: np.random.Generator,
    count: Callable[[Sequence[bytes]], Counts],
) -> Counts:
    """Counts of random states in and around the operating box, and of the neighbours of the most
    expensive ones.

    Every generation has `states` of them; there are GENERATIONS.
    """
    low, high = _ranges(preset)
    population = rng.uniform(low, high, (states, len(low)))
    seen: list[Counts] = []
    for _ in range(GENERATIONS):
        counts = count([state(_state(row)) for row in population])
        seen.append(counts)
        worst = np.argsort(counts.together)[-_KEPT:]
        parents = population[rng.choice(worst, states)]
        steps = rng.normal(0.0, _STEP, parents.shape) * (high - low)
        population = np.clip(parents + steps, low, high)
    return Counts(*(np.concatenate(column) for column in zip(*seen)))


def _ranges(preset: Preset) -> tuple[Array, Array]:
    ranges = (
        *(_widened(low, high) for low, high in preset.operating_box.ranges()),
        _CORE_ABOVE_SURFACE_K,
        (0.0, 1.0),
        (preset.limits.reference_current_A, _WEAKEST_REFERENCE_A),
    )
    low, high = np.array(ranges).T
    return low, high


def _widened(low: float, high: float) -> tuple[float, float]:
    """Inputs outside the box are flagged, which costs something too."""
    margin = _BEYOND_BOX * (high - low)
    return low - margin, high + margin


def _state(row: Array) -> State:
    current_A, cooling_W, surface_K, coolant_K, rise_K, soc, reference_A = map(float, row)
    return State(current_A, cooling_W, surface_K, coolant_K, surface_K + rise_K, soc, reference_A)
