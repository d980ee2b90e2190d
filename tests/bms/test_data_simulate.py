"""Simulated samples are those of the cell's differential equations."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bms.cell import CellState, rates
from bms.data.profiles import SAMPLE_PERIOD_S, Profiles, draw_profiles
from bms.data.simulate import PROCESS_NOISE_K_PER_S, joined, simulate
from bms.presets import load_preset, one_cell_preset_names


class NoNoise:
    """Random source whose normal numbers are all zero."""

    def standard_normal(self, shape):
        return np.zeros(shape)


def profiles_with(current_A, core_limit_K=np.inf, temperature_K=295.0, soc=0.1):
    current_A = np.atleast_2d(np.asarray(current_A, dtype=float))
    count = len(current_A)
    return Profiles(
        "dynamic",
        current_A,
        np.full(count, 0.5),
        np.full(count, temperature_K),
        np.full(count, soc),
        np.full(count, core_limit_K),
    )


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_samples_follow_the_equations_through_a_step_of_10c(name):
    preset = load_preset(name)
    current_A = np.concatenate([np.full(60, -23.0), np.full(60, 0.0)])

    samples = simulate(preset, profiles_with(current_A), NoNoise())

    def slope(time_s, state):
        now_A = current_A[min(int(time_s / SAMPLE_PERIOD_S), len(current_A) - 1)]
        return rates(preset.cell, CellState(*state), now_A, 0.5)

    state, expected = np.array([0.1, 295.0, 295.0, 295.0]), []
    for number in range(len(current_A)):
        expected.append(state)
        span = (number * SAMPLE_PERIOD_S, (number + 1 - 1e-12) * SAMPLE_PERIOD_S)
        state = solve_ivp(slope, span, state, rtol=1e-11, atol=1e-11).y[:, -1]
    expected = np.array(expected)
    np.testing.assert_allclose(samples.core_temperature_K, expected[:, 1], atol=1e-4)
    np.testing.assert_allclose(samples.inputs[:, 2:], expected[:, 2:], atol=1e-4)
    np.testing.assert_array_equal(samples.inputs[:, 0], current_A)
    np.testing.assert_array_equal(samples.inputs[:, 1], 0.5)


def test_process_noise_has_the_papers_strength_on_every_thermal_rate():
    preset = load_preset("paper_calibrated")
    still = profiles_with(np.zeros((4000, 2)))

    noisy = simulate(preset, still, np.random.default_rng(0))
    calm = simulate(preset, still, NoNoise())

    # Second sample of each profile: one second after the start.
    late = slice(4000, 8000)
    for after, without in (
        (noisy.core_temperature_K[late], calm.core_temperature_K[late]),
        (noisy.inputs[late, 3], calm.inputs[late, 3]),
    ):
        spread = np.std(after - without) / SAMPLE_PERIOD_S
        assert spread == pytest.approx(PROCESS_NOISE_K_PER_S, rel=0.1)


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_derating_keeps_the_core_at_its_limit(name):
    preset = load_preset(name)
    wanted = profiles_with(np.full(1200, -23.0), core_limit_K=305.0, soc=0.0)

    samples = simulate(preset, wanted, NoNoise())

    assert 304.0 < samples.core_temperature_K.max() < 305.05
    assert samples.inputs[:, 0].max() > -20.0
    assert np.all((samples.inputs[:, 0] >= -23.0) & (samples.inputs[:, 0] <= 0.0))


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_every_sample_lies_in_the_box_and_profiles_end_when_full(name):
    preset = load_preset(name)
    rng = np.random.default_rng(0)
    low, high = np.transpose(preset.operating_box.ranges())

    for kind in ("constant", "dynamic"):
        samples = simulate(preset, draw_profiles(preset, kind, 10, rng), rng)
        assert np.all((samples.inputs >= low) & (samples.inputs <= high))
        assert set(samples.profile) == set(range(10))
    full = simulate(preset, profiles_with(np.full(900, -4.6), soc=0.95), NoNoise())
    assert len(full.core_temperature_K) == pytest.approx(
        0.05 * preset.cell.capacity_As / 4.6, abs=2
    )


def test_joined_profiles_keep_numbers_of_their_own():
    preset = load_preset("lin2014")
    part = simulate(preset, profiles_with(np.zeros((3, 5))), NoNoise())
    other = dataclasses.replace(part, core_temperature_K=part.core_temperature_K + 1.0)

    whole = joined([part, other])

    assert sorted(set(whole.profile)) == [0, 1, 2, 3, 4, 5]
    np.testing.assert_array_equal(whole.core_temperature_K[15:], other.core_temperature_K)
    assert whole.inputs.shape == (30, 4)
