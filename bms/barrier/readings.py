"""How far what the firmware reads and counts may be from the truth: sensors, bus and float32."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.barrier.rounding import ROUNDINGS, UNIT
from bms.bus_signals import BUS, BusQuantisation
from bms.cell import CellParameters
from bms.presets.schema import Preset

COUNTING_HORIZON_S = 3600.0
"""Longest charge over which coulomb counting has to stay within its error bound."""


@dataclass(frozen=True)
class ReadingErrors:
    """Largest error of each reading on the bus, from sensor and quantisation."""

    surface_K: float
    coolant_K: float
    cooling_W: float


def reading_errors(preset: Preset, bus: BusQuantisation = BUS) -> ReadingErrors:
    """Sensor error and half a step on the bus."""
    sensors = preset.sensors
    return ReadingErrors(
        sensors.surface_temperature_K.error_bound + bus.surface_temperature_K,
        sensors.coolant_temperature_K.error_bound + bus.coolant_temperature_K,
        sensors.cooling_power_W.error_bound + bus.cooling_power_W,
    )


def soc_reserve(cell: CellParameters, preset: Preset, bus: BusQuantisation = BUS) -> float:
    """What is added to the counted state of charge before it decides: the fullest possible cell.

    None for a family, which follows the interval of its charge itself.
    """
    return 0.0 if preset.cell.interval is not None else soc_error_bound(cell, preset, bus)


def soc_error_bound(cell: CellParameters, preset: Preset, bus: BusQuantisation = BUS) -> float:
    """Bound on the counted state of charge: steady errors add up, noise grows as the root.

    Float32 rounds every counted change relative to itself, and all of them are at most one.
    """
    sensor = preset.sensors.current_A
    steady_A = abs(sensor.bias) + 0.5 * sensor.resolution + bus.current_A
    noise_As = (
        sensor.NOISE_CUTOFF
        * sensor.noise_std
        * float(np.sqrt(preset.timing.sampling_period_s * COUNTING_HORIZON_S))
    )
    return (
        (steady_A * COUNTING_HORIZON_S + noise_As) / cell.capacity_As
        + preset.uncertainty.soc_per_s * COUNTING_HORIZON_S
        + bus.plug_in_soc
        + ROUNDINGS * UNIT
    )
