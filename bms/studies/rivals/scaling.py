"""Scaling of the four inputs and of the core temperature to about -1..1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.data.simulate import Samples
from bms.studies.rivals.estimator import BASE_COLUMNS

_SMALLEST_HALF_RANGE = 1e-3


@dataclass(frozen=True)
class Scaling:
    """Center and half range of each input (4,) and of the output in K."""

    center: Array
    half_range: Array
    output_center_K: float
    output_half_range_K: float

    @classmethod
    def of(cls, samples: Samples) -> Scaling:
        """The ranges of the samples; a channel that does not vary gets a small one."""
        columns = np.column_stack(
            [samples.inputs[:, list(BASE_COLUMNS)], samples.core_temperature_K]
        )
        low, high = columns.min(axis=0), columns.max(axis=0)
        center = 0.5 * (low + high)
        half = np.maximum(0.5 * (high - low), _SMALLEST_HALF_RANGE)
        return cls(center[:-1], half[:-1], float(center[-1]), float(half[-1]))

    def of_inputs(self, inputs: Array) -> Array:
        """Scaled inputs (N, 4) from inputs (N, 4 or more)."""
        scaled: Array = (inputs[:, list(BASE_COLUMNS)] - self.center) / self.half_range
        return scaled

    def output(self, samples: Samples) -> Array:
        """Scaled core temperature (N,)."""
        scaled: Array = (
            samples.core_temperature_K - self.output_center_K
        ) / self.output_half_range_K
        return scaled

    def temperature_K(self, scaled: Array) -> Array:
        """Core temperature in K (N,) from its scaled value."""
        return self.output_center_K + self.output_half_range_K * scaled
