"""Lagged inputs are first-order low-passes, exactly, however the recording is sampled."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete, lsim

from bms.data.datasets import simulated_split
from bms.data.lags import Lag, at_rest, settling_time_s, step
from bms.data.measurements import Measurements
from bms.presets import load_preset

CURRENT = Lag("current_squared_A2", 10.0)
SURFACE = Lag("surface_temperature_rise_K", 10.0)


def low_pass(constant_s):
    return [1.0], [constant_s, 1.0]


@given(step_s=st.floats(0.01, 50.0), constant_s=st.floats(0.5, 300.0))
def test_a_held_current_is_filtered_as_the_exact_discretisation_says(step_s, constant_s):
    rate = np.array([[1.0 / constant_s]])
    a, b, *_ = cont2discrete((-rate, rate, np.eye(1), np.zeros((1, 1))), step_s)
    lag = Lag("current_squared_A2", constant_s)

    after = step((lag,), np.array([[200.0]]), step_s, -23.0, 0.0)

    assert after[0, 0] == pytest.approx(a[0, 0] * 200.0 + b[0, 0] * 529.0, rel=1e-9)


def test_rise_is_the_temperature_less_its_low_pass_whatever_the_sampling():
    times_s = np.cumsum(np.random.default_rng(1).uniform(0.1, 3.0, 400))
    dense_s = np.linspace(times_s[0], times_s[-1], 200_001)
    # Straight between samples, which is what the filter assumes.
    surface_K = 300.0 + 6.0 * np.sin(times_s / 40.0)
    dense_K = np.interp(dense_s, times_s, surface_K)
    start_K = surface_K[0]
    _, filtered_K, _ = lsim(low_pass(10.0), dense_K - start_K, dense_s - dense_s[0])
    oracle_K = np.interp(times_s, dense_s, dense_K - start_K - filtered_K)
    zero = np.zeros_like(times_s)

    recording = Measurements(times_s, zero, zero, surface_K, zero, zero)

    assert recording.samples((SURFACE,)).inputs[:, 4] == pytest.approx(oracle_K, abs=2e-4)


def test_simulated_profiles_begin_at_rest_and_end_near_the_square_of_a_long_current():
    data = simulated_split(load_preset("lin2014"), "test", 0, 3, (CURRENT, SURFACE))["constant"]
    for profile in range(3):
        rows = data.inputs[data.profile == profile]
        assert np.all(rows[0, 4:] == 0.0)
        elapsed_s = len(rows) - 1
        expected = rows[0, 0] ** 2 * (1.0 - np.exp(-elapsed_s / 10.0))
        assert rows[-1, 4] == pytest.approx(expected, rel=1e-9)


def test_less_than_a_hundredth_of_a_wrong_start_is_left_after_the_settling_time():
    lags = (CURRENT, SURFACE, Lag("current_squared_A2", 40.0))
    wrong = at_rest(lags, 1) + 100.0
    assert settling_time_s(lags) == 200.0
    assert settling_time_s(()) == 0.0

    right = step(lags, at_rest(lags, 1), settling_time_s(lags), -5.0, 0.3)

    assert np.all(np.abs(step(lags, wrong, settling_time_s(lags), -5.0, 0.3) - right) < 1.0)
