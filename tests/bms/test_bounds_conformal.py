"""The conformal bound is the stated order statistic and covers what it says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.bounds.conformal import (
    over_blocks,
    over_profiles,
    profile_scores_K,
    quantile_K,
    units_needed,
)
from bms.errors import InputError


@pytest.mark.parametrize(("units", "confidence"), [(19, 0.95), (59, 0.9), (120, 0.95)])
def test_a_further_exchangeable_score_stays_below_as_often_as_stated(units, confidence):
    rng = np.random.default_rng(8)
    trials = 20_000
    scores = rng.exponential(size=(trials, units + 1))
    bounds = np.array([quantile_K(row[:-1], confidence) for row in scores])

    coverage = np.mean(scores[:, -1] <= bounds)

    spread = 4.0 * np.sqrt(confidence * (1 - confidence) / trials)
    assert confidence - spread <= coverage <= confidence + 1 / (units + 1) + spread


@given(st.lists(st.floats(0.0, 10.0), min_size=19, max_size=200), st.sampled_from([0.5, 0.9, 0.95]))
def test_bound_is_the_order_statistic_of_the_definition(scores, confidence):
    value = quantile_K(np.array(scores), confidence)

    at_least = sum(score <= value for score in scores)
    below = sum(score < value for score in scores)
    assert at_least >= confidence * (len(scores) + 1) - 1e-6
    assert below < confidence * (len(scores) + 1)
    assert value in scores


@pytest.mark.parametrize(("confidence", "needed"), [(0.5, 1), (0.9, 9), (0.95, 19), (0.99, 99)])
def test_too_few_units_for_the_confidence_are_refused(confidence, needed):
    assert units_needed(confidence) == needed
    assert quantile_K(np.arange(float(needed)), confidence) == needed - 1
    with pytest.raises(InputError, match=f"at least {needed}"):
        quantile_K(np.arange(needed - 1.0), confidence)


def test_score_of_a_profile_is_its_largest_error_of_either_sign():
    error_K = np.array([0.1, -0.5, 0.2, 0.3, -0.1])

    scores_K = profile_scores_K(error_K, np.array([4, 9, 4, 9, 4]))

    assert scores_K.tolist() == [0.2, 0.5]


def test_whole_profiles_are_the_units():
    profile = np.repeat(np.arange(20), 7)
    error_K = np.zeros(140)
    error_K[::7] = np.linspace(0.0, 1.9, 20)

    bound = over_profiles(error_K, profile, 0.9)

    assert (bound.units, bound.unit, bound.confidence) == (20, "profile", 0.9)
    assert bound.value_K == pytest.approx(1.8)


def test_blocks_of_a_recording_are_as_few_as_will_do_and_keep_a_single_peak():
    error_K = np.zeros(1000)
    error_K[503] = -0.7

    bound = over_blocks(error_K, 0.95)

    assert (bound.units, bound.unit) == (19, "block")
    assert bound.value_K == 0.7
    with pytest.raises(InputError, match="too few"):
        over_blocks(error_K[:18], 0.95)
