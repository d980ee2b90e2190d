"""Error figures of an estimate, and the error bound that the controller reckons with."""

from __future__ import annotations

import numpy as np

from bms.barrier.margins import BusQuantisation
from bms.kan.basis import Array
from bms.kan.model_file import ErrorFigures
from bms.kan.network import Network
from bms.presets.schema import Sensors

ARITHMETIC_K = 1e-3
"""Allowance for float32 and the firmware's tables; tests hold the C code to it."""


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
    """Largest change of the estimate that errors of the inputs (N, 4) can cause, to first order.

    Every sensor is off by its bound and every signal by half a step of the bus, all in the worst
    direction at once.
    """
    bounds = (
        sensors.current_A.error_bound + bus.current_A,
        sensors.cooling_power_W.error_bound + bus.cooling_power_W,
        sensors.surface_temperature_K.error_bound + bus.surface_temperature_K,
        sensors.coolant_temperature_K.error_bound + bus.coolant_temperature_K,
    )
    total = np.zeros(len(inputs))
    for column, bound in enumerate(bounds):
        shift = np.zeros(len(bounds))
        shift[column] = bound
        total += 0.5 * np.abs(
            network.evaluate(inputs + shift)[0] - network.evaluate(inputs - shift)[0]
        )
    return float(total.max())
