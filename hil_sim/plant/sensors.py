"""Readings of the five measured quantities with resolution, noise and bias of a preset."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bms.presets.schema import Sensor, Sensors


class Readings(NamedTuple):
    """What is measured: current (A), voltage (V), two temperatures (K), cooling power (W)."""

    current_A: float
    voltage_V: float
    surface_temperature_K: float
    coolant_temperature_K: float
    cooling_power_W: float


class SensorSuite:
    """Turns true values into readings; deterministic for a given generator."""

    def __init__(self, sensors: Sensors, rng: np.random.Generator) -> None:
        self._channels: list[Sensor] = [getattr(sensors, name) for name in Readings._fields]
        self._rng = rng

    def read(self, truth: Readings) -> Readings:
        """Reading of each channel: truth, bias and noise, rounded to the resolution."""
        normals = self._rng.standard_normal(len(truth)).tolist()
        return Readings(*map(_reading, self._channels, truth, normals))


def _reading(sensor: Sensor, truth: float, normal: float) -> float:
    noise = sensor.noise_std * min(max(normal, -Sensor.NOISE_CUTOFF), Sensor.NOISE_CUTOFF)
    value = truth + sensor.bias + noise
    if sensor.resolution == 0.0:
        return value
    return sensor.resolution * round(value / sensor.resolution)
