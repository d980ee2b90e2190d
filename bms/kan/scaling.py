"""How physical inputs and outputs become the numbers near 1 that networks are trained on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.data.simulate import Samples
from bms.errors import InputError
from bms.kan.domain import Domain
from bms.kan.network import INPUT_NAMES, Network
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import TrainableLayer

Ranges = tuple[tuple[float, float], ...]
_LEAST_OUTPUT_HALF_RANGE_K = 1e-3
"""A recording at one temperature still needs a scale."""


@dataclass(frozen=True)
class Scaling:
    """Middle and half width of every input (n_in,) and of the core temperature in K."""

    input_center: Array
    input_half_range: Array
    output_center_K: float
    output_half_range_K: float

    @classmethod
    def of(cls, training: Samples, ranges: Ranges, settings: TrainingSettings) -> Scaling:
        """Scaling to the box of `ranges` and to the core temperatures of the training samples.

        Raises InputError when the width does not fit the inputs.
        """
        if settings.width[0] != len(ranges):
            raise InputError(f"width: must begin with {len(ranges)}, the number of inputs")
        low, high = np.transpose(np.asarray(ranges))
        coldest_K = float(training.core_temperature_K.min())
        warmest_K = float(training.core_temperature_K.max())
        return cls(
            0.5 * (low + high),
            0.5 * (high - low),
            0.5 * (warmest_K + coldest_K),
            max(0.5 * (warmest_K - coldest_K), _LEAST_OUTPUT_HALF_RANGE_K),
        )

    def normalised(self, samples: Samples) -> tuple[Array, Array]:
        """Inputs (n_in, N) and target (N,) near -1..1."""
        x = np.ascontiguousarray(((samples.inputs - self.input_center) / self.input_half_range).T)
        return x, (samples.core_temperature_K - self.output_center_K) / self.output_half_range_K

    def network(
        self, layers: list[TrainableLayer], settings: TrainingSettings, reach: float, domain: Domain
    ) -> Network:
        """The finished network of trained layers."""
        return Network(
            settings.degree,
            (*INPUT_NAMES, *(lag.input_name for lag in settings.lags)),
            tuple(self.input_center.tolist()),
            tuple(self.input_half_range.tolist()),
            self.output_center_K,
            self.output_half_range_K,
            tuple(layer.frozen() for layer in layers),
            settings.lags,
            domain,
            reach,
        )
