"""What the estimators are run on: profiles in order, sensors, lagged inputs."""

import dataclasses

import numpy as np
import pytest

from bms.data.lags import Lag
from bms.data.simulate import joined
from bms.presets import load_preset
from bms.presets.schema import Sensor
from bms.studies.rivals.estimator import Sequences
from bms.studies.rivals.lagged import lagged_columns
from bms.studies.rivals.readings import as_read
from tests.bms.rival_samples import PERIOD_S, charge

LAGS = (Lag("current_squared_A2", 20.0), Lag("surface_temperature_rise_K", 35.0))
SENSORS = load_preset("lin2014").sensors
PERFECT = Sensor(resolution=0.0, noise_std=0.0, bias=0.0)


def sensors(**channels):
    """Perfect sensors but for the channels given."""
    names = [field.name for field in dataclasses.fields(SENSORS)]
    return dataclasses.replace(SENSORS, **{name: PERFECT for name in names} | channels)


def test_sequences_put_interleaved_profiles_one_after_another():
    both = joined([charge(30, seed=1), charge(20, seed=2)])
    order = np.lexsort((both.profile, both.time_s))
    mixed = type(both)(
        both.inputs[order], both.core_temperature_K[order], both.profile[order], both.time_s[order]
    )

    data = Sequences.of(mixed)

    assert data.starts.tolist() == [0, 30, 50]
    assert np.array_equal(data.core_temperature_K, both.core_temperature_K)
    assert np.array_equal(data.inputs, both.inputs.astype(np.float32))
    assert data.head(1).starts.tolist() == [0, 30]
    assert data.head(49).starts.tolist() == [0, 30]
    assert data.head(50).starts.tolist() == data.head(51).starts.tolist() == [0, 30, 50]


def test_perfect_sensors_change_nothing():
    samples = charge(50)

    read = as_read(sensors(), samples, (), np.random.default_rng(0))

    assert np.array_equal(read.inputs, samples.inputs)


def test_sensors_add_bias_and_noise_and_round_to_their_resolution():
    samples = charge(4000)
    channel = Sensor(resolution=0.05, noise_std=0.1, bias=0.3)

    read = as_read(sensors(coolant_temperature_K=channel), samples, (), np.random.default_rng(0))

    error_K = read.inputs[:, 3] - samples.inputs[:, 3]
    steps = read.inputs[:, 3] / 0.05
    assert np.array_equal(read.inputs[:, :3], samples.inputs[:, :3])
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    assert error_K.mean() == pytest.approx(0.3, abs=0.01)
    assert error_K.std() == pytest.approx(0.1, abs=0.01)
    assert np.abs(error_K).max() <= channel.error_bound + 1e-9


def test_lagged_columns_are_low_passes_of_heat_and_surface_temperature():
    time_s = PERIOD_S * np.arange(3)
    inputs = np.array([[-10.0, 0, 300.0, 0], [-10.0, 0, 302.0, 0], [0.0, 0, 301.0, 0]])

    columns = lagged_columns(LAGS, inputs, time_s)

    # Of a step of the heat after one and two periods, and of ramps by +2 K and -1 K.
    fast, slow = np.exp(-PERIOD_S / 20.0), np.exp(-PERIOD_S / 35.0)
    rise_K = 35.0 * (1.0 - slow) / PERIOD_S
    assert columns[:, 0] == pytest.approx([0.0, 100.0 * (1.0 - fast), 100.0 * (1.0 - fast**2)])
    assert columns[:, 1] == pytest.approx([0.0, 2.0 * rise_K, 2.0 * rise_K * slow - rise_K])


def test_an_offset_of_the_current_reaches_the_filtered_heat():
    samples = charge(300)
    columns = lagged_columns(LAGS, samples.inputs, samples.time_s)
    lagged = dataclasses.replace(samples, inputs=np.hstack([samples.inputs, columns]))
    biased = sensors(current_A=Sensor(resolution=0.0, noise_std=0.0, bias=-0.5))

    read = as_read(biased, lagged, LAGS, np.random.default_rng(0))

    expected = lagged_columns(LAGS, read.inputs, samples.time_s)
    assert read.inputs[:, 0] == pytest.approx(samples.inputs[:, 0] - 0.5)
    assert read.inputs[:, 4:] == pytest.approx(expected)
    assert np.abs(read.inputs[:, 4] - lagged.inputs[:, 4]).max() > 1.0
