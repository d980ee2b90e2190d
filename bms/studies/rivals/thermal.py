"""The linear two-state thermal model in discrete time, and the noise that filters reckon with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.signal import cont2discrete

from bms.arrays import Array
from bms.cell import CellParameters
from bms.presets.schema import Sensor


@dataclass(frozen=True)
class FilterNoise:
    """Standard deviations: of the rates (constant over a period), of a reading, of the start.

    `start_K` is the distance of the core from thermal rest. The ohmic
    resistance, relative to the one in the model, matters to the extended filter only.
    """

    core_K_per_s: float
    surface_K_per_s: float
    reading_K: float
    start_K: float
    resistance_start: float
    resistance_drift_per_sqrt_s: float


def reading_std(sensor: Sensor) -> float:
    """Standard deviation of a reading, in the channel's unit: noise and rounding."""
    return float(np.hypot(sensor.noise_std, sensor.resolution / np.sqrt(12.0)))


@dataclass(frozen=True)
class DiscreteCell:
    """Core and surface one period later: transition (2, 2), effect of heat (2,) in K/W.

    Temperatures are distances from the coolant. `rate_gain_s` (2, 2) is the effect of an addition
    to the two rates that stays constant over the period.
    """

    transition: Array
    heat_gain_K_per_W: Array
    rate_gain_s: Array

    @classmethod
    def of(cls, cell: CellParameters, period_s: float) -> DiscreteCell:
        """Exact for heat, coolant and disturbances that stay constant over the period."""
        inner_W_per_K = 1.0 / cell.core_resistance_K_per_W
        outer_W_per_K = 1.0 / cell.surface_resistance_K_per_W
        capacity = np.array([cell.core_heat_capacity_J_per_K, cell.surface_heat_capacity_J_per_K])
        flows = np.array(
            [[-inner_W_per_K, inner_W_per_K], [inner_W_per_K, -inner_W_per_K - outer_W_per_K]]
        )
        continuous = (flows / capacity[:, None], np.eye(2), np.eye(2), np.zeros((2, 2)))
        transition, rate_gain_s, *_ = cont2discrete(continuous, period_s)
        return cls(transition, rate_gain_s[:, 0] / capacity[0], rate_gain_s)

    def process_noise(self, noise: FilterNoise) -> Array:
        """Covariance (2, 2) in K^2 that a period adds."""
        rates = np.array([noise.core_K_per_s, noise.surface_K_per_s])
        scaled = self.rate_gain_s * rates
        covariance: Array = scaled @ scaled.T
        return covariance

    def steady_gain(self, noise: FilterNoise) -> Array:
        """Kalman gain (2,) in steady state for a reading of the surface."""
        measured = np.array([[0.0], [1.0]])
        predicted = solve_discrete_are(
            self.transition.T, measured, self.process_noise(noise), [[noise.reading_K**2]]
        )
        gain: Array = predicted[:, 1] / (predicted[1, 1] + noise.reading_K**2)
        return gain
