"""Readings: resolution, noise with a hard bound, bias."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.presets import load_preset
from bms.presets.schema import Sensor, Sensors
from hil_sim.plant.sensors import Readings, SensorSuite

SHIPPED = load_preset("paper_calibrated").sensors


def suite(sensor: Sensor, seed: int = 0) -> SensorSuite:
    sensors = Sensors(**{field.name: sensor for field in fields(Sensors)})
    return SensorSuite(sensors, np.random.default_rng(seed))


def sample(sensor: Sensor, truth: float, count: int) -> np.ndarray:
    chosen = suite(sensor)
    return np.array([chosen.read(Readings(*[truth] * 5)) for _ in range(count)]).ravel()


finite = st.floats(-500.0, 500.0)


@given(truth=st.tuples(*[finite] * 5), seed=st.integers(0, 2**32))
def test_a_reading_is_within_the_error_bound_that_the_margins_use(truth, seed):
    readings = SensorSuite(SHIPPED, np.random.default_rng(seed)).read(Readings(*truth))
    for name, reading, true in zip(Readings._fields, readings, truth):
        assert abs(reading - true) <= getattr(SHIPPED, name).error_bound + 1e-9


def test_noise_reaches_its_cutoff_and_never_passes_it():
    error = np.abs(sample(Sensor(0.0, 0.5, 0.0), 10.0, 40_000) - 10.0)
    assert error.max() <= 4 * 0.5 * (1 + 1e-12)
    assert error.max() > 3.8 * 0.5


def test_noise_has_the_stated_deviation_and_bias():
    readings = sample(Sensor(0.0, 0.2, 0.03), -3.0, 20_000)
    assert readings.std() == pytest.approx(0.2, rel=0.02)
    assert readings.mean() == pytest.approx(-2.97, abs=0.003)


@given(truth=finite, seed=st.integers(0, 1000))
def test_readings_lie_on_the_grid_of_the_resolution(truth, seed):
    reading = suite(Sensor(0.01, 0.005, 0.0), seed).read(Readings(*[truth] * 5))[0]
    assert abs(reading / 0.01 - round(reading / 0.01)) < 1e-6


def test_a_perfect_sensor_returns_the_truth():
    assert suite(Sensor(0.0, 0.0, 0.0)).read(Readings(1.5, 2.5, 3.5, 4.5, 5.5)) == (
        1.5,
        2.5,
        3.5,
        4.5,
        5.5,
    )


def test_each_channel_has_its_own_sensor():
    biased = replace(SHIPPED, cooling_power_W=Sensor(0.0, 0.0, 7.0))
    reading = SensorSuite(biased, np.random.default_rng(0)).read(Readings(0, 0, 0, 0, 1.0))
    assert reading.cooling_power_W == 8.0
    assert abs(reading.coolant_temperature_K) < 1.0
