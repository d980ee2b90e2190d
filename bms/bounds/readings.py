"""What errors of the readings, by sensors and bus, can add to the error of the estimate."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.bus_signals import BusQuantisation
from bms.kan.network import INPUT_NAMES, Network
from bms.presets.schema import Sensors


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
