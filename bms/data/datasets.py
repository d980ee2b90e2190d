"""Splits of data: simulated profiles by whole profiles, a recording by time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from bms.data.cooling import Cooling
from bms.data.lags import Lags
from bms.data.profiles import KINDS, Kind, draw_profiles
from bms.data.simulate import Samples, simulate_sets
from bms.presets import Preset

Split = Literal["training", "validation", "test", "evaluation"]
_SPLITS: tuple[Split, ...] = ("training", "validation", "test", "evaluation")

TRAINING_SHARE = 2.0 / 3.0
"""Of a recording, from its beginning; the rest tests."""

PROFILES_OF_EACH_KIND: dict[Split, int] = {
    "training": 100,
    "validation": 30,
    "test": 60,
    "evaluation": 60,
}


def simulated_split(
    preset: Preset,
    split: Split,
    seed: int,
    count: int | None = None,
    lags: Lags = (),
    cooling: Cooling = Cooling.LINEAR,
) -> dict[Kind, Samples]:
    """Constant and dynamic profiles of one split, `count` of each kind (None: as shipped).

    No profile has samples in two splits. Every pair of seed and split has its own random stream;
    "evaluation" is used nowhere in training, so that `bms evaluate` shows profiles that not even
    e_max was read from.
    """
    counts = {split: PROFILES_OF_EACH_KIND[split] if count is None else count}
    return simulated_splits(preset, counts, seed, lags, cooling)[split]


def simulated_splits(
    preset: Preset,
    counts: Mapping[Split, int],
    seed: int,
    lags: Lags = (),
    cooling: Cooling = Cooling.LINEAR,
) -> dict[Split, dict[Kind, Samples]]:
    """Several splits as simulated_split gives each, with `counts` profiles of each kind."""
    rngs = [np.random.default_rng([seed, _SPLITS.index(split)]) for split in counts]
    data: dict[Split, dict[Kind, Samples]] = {split: {} for split in counts}
    for kind in KINDS:
        sets = [draw_profiles(preset, kind, n, rng) for n, rng in zip(counts.values(), rngs)]
        for split, samples in zip(counts, simulate_sets(preset, sets, rngs, lags, cooling)):
            data[split][kind] = samples
    return data


def training_rows(rows: int) -> int:
    """How many rows of a recording, from the first, are for training or fitting."""
    return round(TRAINING_SHARE * rows)


def split_by_time(recording: Samples) -> tuple[Samples, Samples]:
    """The first two thirds of a recording, for training, and the last one, for testing."""
    cut = training_rows(len(recording.core_temperature_K))
    return recording.rows(slice(cut)), recording.rows(slice(cut, None))
