"""Faults of a sensor: what is read in place of the healthy reading."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bms.cell import CellState
from bms.validation import Finite, Positive, strict
from hil_sim.faults.base import Fault

SensorName = Literal[
    "current_A",
    "voltage_V",
    "surface_temperature_K",
    "coolant_temperature_K",
    "cooling_power_W",
]

_CELSIUS_OFFSET_K = 273.15
_MILLI = 1000.0


@dataclass
class SensorMemory:
    """What a sensor fault knows of its run."""

    rng: np.random.Generator
    last_healthy: float = math.nan
    age_s: float = 0.0


@strict
@dataclass(frozen=True, kw_only=True)
class SensorFault(Fault):
    """Replaces the reading of one sensor; values are in the unit of the sensor's name."""

    sensor: SensorName

    @property
    def where(self) -> str:
        """Name of the sensor, which ends with its unit."""
        return self.sensor

    @abstractmethod
    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """What is read instead; NaN stands for not available."""


@strict
@dataclass(frozen=True, kw_only=True)
class SensorStuck(SensorFault):
    """The last reading from before stays."""

    kind: Literal["sensor-stuck"]

    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """The last healthy reading, whatever the present one is."""
        return memory.last_healthy


@strict
@dataclass(frozen=True, kw_only=True)
class SensorDrifting(SensorFault):
    """The reading moves away at a constant rate."""

    kind: Literal["sensor-drifting"]
    rate_per_s: Finite

    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """The reading and rate_per_s times the age of the fault."""
        return healthy + self.rate_per_s * memory.age_s


@strict
@dataclass(frozen=True, kw_only=True)
class SensorBiased(SensorFault):
    """The reading is off by a constant."""

    kind: Literal["sensor-biased"]
    offset: Finite

    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """The reading and `offset`."""
        return healthy + self.offset


@strict
@dataclass(frozen=True, kw_only=True)
class SensorOutOfRange(SensorFault):
    """One value is read, as from an open or shorted wire; the bus saturates at its signal range."""

    kind: Literal["sensor-out-of-range"]
    value: Finite

    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """`value`, whatever the present reading is."""
        return self.value


@strict
@dataclass(frozen=True, kw_only=True)
class SensorJumping(SensorFault):
    """The reading jumps up or down by an amplitude, at random in every period."""

    kind: Literal["sensor-jumping"]
    amplitude: Positive

    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """The reading one amplitude above or below."""
        return healthy + self.amplitude * float(memory.rng.choice((-1.0, 1.0)))


@strict
@dataclass(frozen=True, kw_only=True)
class SensorUnitSwapped(SensorFault):
    """Degrees Celsius are sent for kelvin, or the thousandth of a unit for the unit."""

    kind: Literal["sensor-unit-swapped"]

    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """The reading as a number of degrees Celsius, or of thousandths of its unit."""
        return healthy - _CELSIUS_OFFSET_K if self.sensor.endswith("_K") else _MILLI * healthy


@strict
@dataclass(frozen=True, kw_only=True)
class SensorNotAvailable(SensorFault):
    """The message says that there is no value: all ones."""

    kind: Literal["sensor-not-available"]

    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """NaN, which the database sends as all ones."""
        return math.nan


@strict
@dataclass(frozen=True, kw_only=True)
class SurfaceAboveCore(SensorFault):
    """The surface is read hotter than the true core, which no charging cell can be."""

    kind: Literal["surface-above-core"]
    sensor: Literal["surface_temperature_K"] = "surface_temperature_K"
    excess_K: Positive

    def reading(self, healthy: float, truth: CellState, memory: SensorMemory) -> float:
        """The true core temperature and `excess_K`."""
        return float(truth.core_temperature_K) + self.excess_K


SENSOR_FAULTS = (
    SensorStuck,
    SensorDrifting,
    SensorBiased,
    SensorOutOfRange,
    SensorJumping,
    SensorUnitSwapped,
    SensorNotAvailable,
    SurfaceAboveCore,
)
