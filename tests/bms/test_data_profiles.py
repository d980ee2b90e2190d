"""Profiles cover the operating box, begin at rest, and are split whole."""

import numpy as np
import pytest

from bms.data.datasets import PROFILES_OF_EACH_KIND, simulated_split
from bms.data.profiles import KINDS, SAMPLE_PERIOD_S, draw_profiles
from bms.presets import load_preset

PRESET = load_preset("paper_calibrated")
BOX = PRESET.operating_box


@pytest.mark.parametrize("kind", KINDS)
def test_wanted_current_lies_in_the_box_and_starts_in_every_part_of_it(kind):
    profiles = draw_profiles(PRESET, kind, 50, np.random.default_rng(0))

    low, high = BOX.current_A
    assert np.all((profiles.wanted_current_A >= low) & (profiles.wanted_current_A <= high))
    coldest_K, warmest_K = BOX.surface_temperature_K
    for values, (low, high) in (
        (profiles.cooling_power_W, BOX.cooling_power_W),
        (profiles.initial_temperature_K, (coldest_K + 2.0, warmest_K - 13.0)),
        (profiles.initial_soc, (0.0, 0.2)),
    ):
        # A Latin hypercube has exactly one value in each of 50 equal parts.
        parts = np.floor(50 * (values - low) / (high - low))
        assert sorted(parts) == list(range(50))


def test_constant_profiles_hold_one_current_each_up_to_the_edges_of_the_box():
    profiles = draw_profiles(PRESET, "constant", 100, np.random.default_rng(0))

    assert np.all(np.ptp(profiles.wanted_current_A, axis=1) == 0.0)
    assert np.all(np.isinf(profiles.core_limit_K))
    low, high = BOX.current_A
    assert profiles.wanted_current_A.min() < low + 0.01 * (high - low)
    assert profiles.wanted_current_A.max() > high - 0.01 * (high - low)


def test_dynamic_profiles_have_rests_ramps_and_steps():
    profiles = draw_profiles(PRESET, "dynamic", 60, np.random.default_rng(0))

    slopes_A_per_s = np.abs(np.diff(profiles.wanted_current_A, axis=1)) / SAMPLE_PERIOD_S
    assert np.mean(profiles.wanted_current_A == 0.0) > 0.05
    assert np.mean((slopes_A_per_s > 0.04) & (slopes_A_per_s <= 1.0)) > 0.05
    assert np.count_nonzero(slopes_A_per_s > 5.0) > 30


def test_splits_and_seeds_have_streams_of_their_own():
    def inputs(split, seed):
        return simulated_split(PRESET, split, seed, 2)["constant"].inputs

    splits = list(PROFILES_OF_EACH_KIND)
    first = [inputs(split, seed)[0, 2] for split in splits for seed in (0, 1)]

    assert len(set(first)) == len(first)
    np.testing.assert_array_equal(inputs("test", 3), inputs("test", 3))
