"""What the sensors of a preset make of samples."""

from __future__ import annotations

import dataclasses

import numpy as np

from bms.data.lags import Lags
from bms.data.simulate import Samples
from bms.kan.network import INPUT_NAMES
from bms.presets.schema import Sensor, Sensors
from bms.studies.rivals.lagged import lagged_columns


def as_read(sensors: Sensors, samples: Samples, lags: Lags, rng: np.random.Generator) -> Samples:
    """The samples with bias, noise and resolution of the sensors in their inputs.

    Lagged inputs change by what the filters make of the errors at the times of the samples.
    """
    read = samples.inputs.copy()
    for column, name in enumerate(INPUT_NAMES):
        sensor: Sensor = getattr(sensors, name)
        noise = rng.standard_normal(len(read)).clip(-Sensor.NOISE_CUTOFF, Sensor.NOISE_CUTOFF)
        read[:, column] += sensor.bias + sensor.noise_std * noise
        if sensor.resolution > 0.0:
            read[:, column] = sensor.resolution * np.round(read[:, column] / sensor.resolution)
    if lags:
        for profile in np.unique(samples.profile):
            rows = np.flatnonzero(samples.profile == profile)
            time_s = samples.time_s[rows]
            read[rows, len(INPUT_NAMES) :] += lagged_columns(
                lags, read[rows], time_s
            ) - lagged_columns(lags, samples.inputs[rows], time_s)
    return dataclasses.replace(samples, inputs=read)
