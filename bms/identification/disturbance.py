"""The disturbance that measured temperatures need: what a cell's model lacks at each moment."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_smoothing_spline

from bms.arrays import Array
from bms.cell import CellParameters
from bms.data.measurements import Measurements
from bms.identification.heat import middle

ACCURACY_K = 0.1
"""Followed by default: what thermometers in and on a cell are worth."""

_SHORTEST = 0.1
"""Of a sampling period: a spline that averages over less goes through every row."""
_LONGEST = 0.1
"""Of the recording: averaged over more, a disturbance is an offset."""
_HALVINGS = 12


@dataclass(frozen=True)
class MissingRate:
    """Rate (N,) that one temperature's model lacks, in K/s.

    With it the model follows the temperature within `error_rms_K`, and at 99.9 % of the rows within
    `error_K`. `time_scale_s` is what the rate is averaged over: shorter ones are left out.
    """

    rate_K_per_s: Array
    error_rms_K: float
    error_K: float
    time_scale_s: float


@dataclass(frozen=True)
class MissingRates:
    """What core, surface and coolant lack; None for a coolant whose cooling was not recorded."""

    core: MissingRate
    surface: MissingRate
    coolant: MissingRate | None


def missing_rates(
    cell: CellParameters, recording: Measurements, heat_W: Array, accuracy_K: float = ACCURACY_K
) -> MissingRates:
    """Rates that the model lacks on a recording, with the heat (N - 1,) between its rows.

    They are the smoothest with which the model follows each temperature within `accuracy_K`, root
    mean square. Cooling power of 0 W throughout says that a chamber set the coolant.
    """
    core_K, surface_K, coolant_K = (
        recording.core_temperature_K,
        recording.surface_temperature_K,
        recording.coolant_temperature_K,
    )
    inner_W = middle(core_K - surface_K) / cell.core_resistance_K_per_W
    outer_W = middle(surface_K - coolant_K) / cell.surface_resistance_K_per_W
    coolant = None
    if np.any(recording.cooling_power_W != 0.0):
        cooled_W = outer_W - recording.cooling_power_W[:-1]
        coolant = missing_rate(
            recording.time_s, coolant_K, cooled_W / cell.coolant_heat_capacity_J_per_K, accuracy_K
        )
    return MissingRates(
        missing_rate(
            recording.time_s,
            core_K,
            (heat_W - inner_W) / cell.core_heat_capacity_J_per_K,
            accuracy_K,
        ),
        missing_rate(
            recording.time_s,
            surface_K,
            (inner_W - outer_W) / cell.surface_heat_capacity_J_per_K,
            accuracy_K,
        ),
        coolant,
    )


def missing_rate(
    time_s: Array, measured_K: Array, known_K_per_s: Array, accuracy_K: float
) -> MissingRate:
    """The smoothest rate that leads from the known one (N - 1,) to the measured temperature (N,).

    What the known rate leaves open is the integral of the missing one, plus noise. Its smoothing
    spline is the estimate of a smoother (Rauch, Tung, Striebel) whose rate is a random walk.
    Source: Wahba 1978; the strength by the discrepancy principle (Morozov 1966).
    """
    steps_s = np.diff(time_s)
    period_s, length_s = float(np.median(steps_s)), float(time_s[-1] - time_s[0])
    open_K = (
        measured_K - measured_K[0] - np.concatenate([[0.0], np.cumsum(known_K_per_s * steps_s)])
    )

    def smoothed(time_scale_s: float) -> tuple[Array, Array]:
        # A cubic smoothing spline passes half of what has this time scale.
        spline = make_smoothing_spline(time_s, open_K, lam=time_scale_s**4 / period_s)
        return spline.derivative()(time_s), open_K - spline(time_s)

    low, high = math.log(_SHORTEST * period_s), math.log(max(_LONGEST * length_s, period_s))
    for _ in range(_HALVINGS):
        center = 0.5 * (low + high)
        if _rms(smoothed(math.exp(center))[1]) <= accuracy_K:
            low = center
        else:
            high = center
    rate_K_per_s, error_K = smoothed(math.exp(low))
    return MissingRate(
        rate_K_per_s,
        _rms(error_K),
        float(np.quantile(np.abs(error_K), 0.999)),
        math.exp(low),
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
