"""The search finds worst cases that are known beforehand, and what it reports can be replayed."""

import dataclasses

import numpy as np
import pytest

from bms.bounds.worst_case import CORE_BEYOND_LIMIT_K, Effort, worst_case
from bms.data.profiles import Profiles, draw_profiles, start_range_K
from bms.data.simulate import simulate
from bms.kan.network import Edge, Network
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset

QUICK = Effort(60, 5)


def always(estimate_K, box):
    """Network that gives one temperature whatever the inputs."""
    knots = tuple(float(k) for k in range(-4, 5))
    edge = Edge(knots, 0.0, 0.0, (0.0,) * 5)
    low, high = np.transpose(box.ranges())
    return Network(
        3,
        ("current_A", "cooling_power_W", "surface_temperature_K", "coolant_temperature_K"),
        tuple((0.5 * (low + high)).tolist()),
        tuple((0.5 * (high - low)).tolist()),
        estimate_K,
        1.0,
        (((edge,) * 4,), ((edge,),)),
    )


@pytest.fixture(scope="module")
def preset():
    return load_preset("paper_calibrated")


def test_planted_worst_case_at_the_hot_limit_is_found(preset):
    hottest_K = preset.limits.max_core_temperature_K + CORE_BEYOND_LIMIT_K

    found = worst_case(always(start_range_K(preset)[0], preset.operating_box), preset, 0, QUICK)

    expected_K = hottest_K - start_range_K(preset)[0]
    assert expected_K - 0.3 <= found.searched_K <= expected_K
    # No charge starts at the limit: the current must have heated the cell up to there.
    assert found.time_s > 5.0


def test_planted_worst_case_at_the_coldest_start_is_found(preset):
    coldest_K = start_range_K(preset)[0]

    found = worst_case(always(325.0, preset.operating_box), preset, 0, QUICK)

    # Cooling takes the cell a little below the temperature that it starts from.
    assert 325.0 - coldest_K - 0.3 <= found.value_K <= 325.0 - coldest_K + 3.0
    assert found.profile.initial_temperature_K == pytest.approx(coldest_K, abs=1.0)


def test_errors_of_estimates_that_are_not_trusted_do_not_count(preset):
    network = always(325.0, preset.operating_box)
    elsewhere = dataclasses.replace(network, input_center=(500.0, *network.input_center[1:]))

    assert worst_case(elsewhere, preset, 0, Effort(5, 1)).value_K == 0.0


def test_worst_profile_can_be_replayed_and_beats_random_steps(preset):
    network = load_shipped_model(preset.name).network
    found = worst_case(network, preset, 1, Effort(100, 6))
    profile = found.profile

    held_s = np.minimum(np.ceil(np.cumsum(profile.hold_s[:-1])), 300).astype(int)
    piece = np.searchsorted(held_s, np.arange(300), side="right")
    replayed = simulate(
        preset,
        Profiles(
            "steps",
            np.array(profile.current_A)[piece][None],
            np.array([profile.cooling_power_W]),
            np.array([profile.initial_temperature_K]),
            np.array([profile.initial_soc]),
            np.array([np.inf if profile.core_limit_K is None else profile.core_limit_K]),
        ),
        np.random.default_rng(77),
        network.lags,
    )
    error_K = np.abs(network.evaluate(replayed.inputs)[0] - replayed.core_temperature_K)
    random = draw_profiles(preset, "steps", 20, np.random.default_rng(5))
    steps = simulate(preset, random, np.random.default_rng(5), network.lags)
    step_error_K = np.abs(network.evaluate(steps.inputs)[0] - steps.core_temperature_K)
    hottest_K = preset.limits.max_core_temperature_K + CORE_BEYOND_LIMIT_K

    at = np.flatnonzero(replayed.time_s == found.time_s)
    assert error_K[at] == pytest.approx(found.searched_K, abs=0.02)
    assert found.value_K >= step_error_K[steps.core_temperature_K <= hottest_K].max() - 0.01


def test_same_seed_finds_the_same(preset):
    network = load_shipped_model(preset.name).network

    again = [worst_case(network, preset, 3, Effort(10, 2)) for _ in range(2)]

    assert again[0] == again[1]


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 1.0])
def test_effort_scales_but_stays_a_search(share):
    scaled = Effort().scaled(share)

    assert 5 <= scaled.candidates <= Effort().candidates
    assert 1 <= scaled.generations <= Effort().generations
