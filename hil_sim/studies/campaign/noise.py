"""Random numbers of a run, by the block: sensor noise and the disturbance at every sub-step."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bms.arrays import Array
from bms.cell import Disturbance
from hil_sim.plant.disturbances import LONGEST_DWELL_S, SHORTEST_DWELL_S, DisturbanceKind

_CHANNELS = 4
_EVENTS_IN_RESERVE = 100


class Streams(NamedTuple):
    """Independent random generators of one run."""

    draw: np.random.Generator
    disturbance: np.random.Generator
    sensors: np.random.Generator


def streams(seed: int, run: int) -> Streams:
    """Generators that depend on seed and run number only, not on who runs what when."""
    children = np.random.SeedSequence(entropy=seed, spawn_key=(run,)).spawn(3)
    return Streams(*(np.random.Generator(np.random.Philox(child)) for child in children))


KnotBlocks = Callable[[int], Array]
"""Returns the next knots (count, 4) in 1/s and K/s each time it is called with a count."""


def knot_blocks(
    kind: DisturbanceKind,
    bounds: Disturbance,
    share: float,
    step_s: float,
    longest_s: float,
    rng: np.random.Generator,
) -> KnotBlocks:
    """Disturbances of hil_sim.plant.disturbances at a share of the bounds, without slope limit."""
    amplitude = share * np.array(bounds)
    if kind is DisturbanceKind.GAUSSIAN:
        return lambda count: amplitude * np.clip(rng.standard_normal((count, _CHANNELS)), -1.0, 1.0)
    if kind is DisturbanceKind.BANG_BANG:
        return _bang_bang(amplitude, step_s, longest_s, rng)
    return lambda count: np.broadcast_to(amplitude, (count, _CHANNELS)).copy()


def _bang_bang(
    amplitude: Array, step_s: float, longest_s: float, rng: np.random.Generator
) -> KnotBlocks:
    """Each channel changes its sign after random times, log-uniform from 10 ms to 100 s."""
    first = rng.choice([-1.0, 1.0], size=_CHANNELS)
    low, high = math.log(SHORTEST_DWELL_S), math.log(LONGEST_DWELL_S)
    mean_dwell_s = (LONGEST_DWELL_S - SHORTEST_DWELL_S) / (high - low)
    events = int(2.0 * longest_s / mean_dwell_s) + _EVENTS_IN_RESERVE
    dwells_s = np.exp(rng.uniform(low, high, size=(_CHANNELS, events)))
    changes = np.cumsum(np.maximum(dwells_s / step_s, 1.0).astype(np.int64), axis=1)
    begin = 0

    def next_block(count: int) -> Array:
        nonlocal begin
        knots = np.empty((count, _CHANNELS))
        for channel, (flips, sign) in enumerate(zip(changes, first)):
            done, due = np.searchsorted(flips, [begin, begin + count - 1], side="right")
            lengths = np.diff([0, *(flips[done:due] - begin), count])
            signs = np.resize([1.0, -1.0], len(lengths)) * (sign if done % 2 == 0 else -sign)
            knots[:, channel] = np.repeat(signs * amplitude[channel], lengths)
        begin += count
        return knots

    return next_block
