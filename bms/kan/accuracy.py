"""Error figures of an estimate, and what errors of the readings add to them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge

from bms.arrays import Array
from bms.barrier.margins import BusQuantisation
from bms.kan.network import INPUT_NAMES, Network
from bms.presets.schema import Sensors
from bms.validation import Finite, NonNegative, strict


@strict
@dataclass(frozen=True)
class ErrorFigures:
    """Error of the estimate (estimate - truth) over some samples."""

    rmse_K: NonNegative
    max_abs_error_K: NonNegative
    bias_K: Finite
    samples: Annotated[int, Ge(1)]


def error_figures(estimate_K: Array, truth_K: Array) -> ErrorFigures:
    """Figures of estimate - truth, both (N,) in K."""
    error = estimate_K - truth_K
    return ErrorFigures(
        rmse_K=float(np.sqrt(np.mean(error**2))),
        max_abs_error_K=float(np.abs(error).max()),
        bias_K=float(error.mean()),
        samples=error.size,
    )


def measurement_error_K(
    network: Network, inputs: Array, sensors: Sensors, bus: BusQuantisation
) -> float:
    """Largest change of the estimate that errors of the inputs (N, n_in) can cause, to first order.

    Every sensor is off by its bound and every signal by half a step of the bus, all in the worst
    direction at once. In a lagged input, errors of the past add up to no more than one of now.
    """
    current_A = sensors.current_A.error_bound + bus.current_A
    surface_K = sensors.surface_temperature_K.error_bound + bus.surface_temperature_K
    shifts = np.diag(
        [
            current_A,
            sensors.cooling_power_W.error_bound + bus.cooling_power_W,
            surface_K,
            sensors.coolant_temperature_K.error_bound + bus.coolant_temperature_K,
            *np.zeros(len(network.lags)),
        ]
    )[: len(INPUT_NAMES)]
    strongest_A = float(np.abs(inputs[:, 0]).max()) + current_A
    for place, lag in enumerate(network.lags, start=len(INPUT_NAMES)):
        past = np.zeros(shifts.shape[1])
        if lag.quantity == "current_squared_A2":
            past[place] = 2.0 * strongest_A * current_A
        else:
            past[place] = surface_K
            shifts[2, place] = surface_K
        shifts = np.vstack([shifts, past])
    total = np.zeros(len(inputs))
    for shift in shifts:
        change_K = network.evaluate(inputs + shift)[0] - network.evaluate(inputs - shift)[0]
        total += 0.5 * np.abs(change_K)
    return float(total.max())
