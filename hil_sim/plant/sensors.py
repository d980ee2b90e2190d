"""Readings of the five measured quantities with resolution, noise and bias of a preset."""

from __future__ import annotations

from collections.abc import Iterator
from operator import add
from typing import NamedTuple

import numpy as np

from bms.presets.schema import Sensor, Sensors

_BLOCK = 500
"""Readings whose noise is drawn at once; the numbers are those of one draw a reading."""


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
        channels: list[Sensor] = [getattr(sensors, name) for name in Readings._fields]
        self._biases = [sensor.bias for sensor in channels]
        self._resolutions = [sensor.resolution for sensor in channels]
        self._noise_std = np.array([sensor.noise_std for sensor in channels])
        self._rng = rng
        self._noise: Iterator[list[float]] = iter(())

    def read(self, truth: Readings) -> Readings:
        """Reading of each channel: truth, bias and noise, rounded to the resolution."""
        noise = next(self._noise, None)
        if noise is None:
            self._noise = iter(self._drawn())
            noise = next(self._noise)
        values = map(add, map(add, truth, self._biases), noise)
        return Readings(
            *[
                value if resolution == 0.0 else resolution * round(value / resolution)
                for value, resolution in zip(values, self._resolutions)
            ]
        )

    def _drawn(self) -> list[list[float]]:
        """Noise of the next readings."""
        normals = self._rng.standard_normal((_BLOCK, len(self._noise_std)))
        cut = np.clip(normals, -Sensor.NOISE_CUTOFF, Sensor.NOISE_CUTOFF)
        noise: list[list[float]] = (self._noise_std * cut).tolist()
        return noise
