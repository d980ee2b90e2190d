"""What a preset holds; the TOML file has these names as keys."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Annotated

from annotated_types import Ge, Gt, Le, MultipleOf

from bms.cell import CellParameters
from bms.errors import InputError
from bms.validation import Finite, Negative, NonNegative, Positive, strict


@strict
@dataclass(frozen=True)
class Limits:
    """Limits of the safe set, the current that is wanted, and how fast it may grow.

    Shrinking is never limited. The limit on growth gives the estimate time to follow the current,
    without which the estimate and the surface constraint can drive each other to and fro.
    """

    max_voltage_V: Positive
    max_soc: Annotated[float, Gt(0.0), Le(1.0)]
    max_core_temperature_K: Positive
    max_surface_temperature_K: Positive
    reference_current_A: Negative
    current_growth_A_per_s: Positive
    completion_soc: Positive


@strict
@dataclass(frozen=True)
class Gains:
    """Barrier gains: 1 for SoC, 2 for the core, 3 and 4 for the surface (s^2 + a4 s + a3).

    An absent core gain means 1/(Rc Cc), at which the estimate drops out of the core constraint.
    Raises InputError unless the surface polynomial is Hurwitz with real roots, because only then
    is the chain dB/dt + lambda B itself a barrier.
    """

    alpha1_per_s: Positive
    alpha3_per_s2: Positive
    alpha4_per_s: Positive
    alpha2_per_s: Positive | None = None

    def __post_init__(self) -> None:
        if self.alpha4_per_s**2 < 4.0 * self.alpha3_per_s2:
            raise InputError(
                "gains: alpha4_per_s^2 must be at least 4 alpha3_per_s2 (real roots); "
                "raise alpha4_per_s or lower alpha3_per_s2"
            )

    def core_gain_per_s(self, cell: CellParameters) -> float:
        """The core gain in force in 1/s."""
        if self.alpha2_per_s is not None:
            return self.alpha2_per_s
        return 1.0 / (cell.core_resistance_K_per_W * cell.core_heat_capacity_J_per_K)


@strict
@dataclass(frozen=True)
class Uncertainty:
    """Bounds on the disturbance of each rate, and on the slope of the surface disturbance."""

    soc_per_s: NonNegative
    core_K_per_s: NonNegative
    surface_K_per_s: NonNegative
    coolant_K_per_s: NonNegative
    surface_rate_K_per_s2: NonNegative


@strict
@dataclass(frozen=True)
class Timing:
    """Control period, and the longest time from a measurement to the current it leads to.

    The period is a whole number of milliseconds, by which the firmware's ports step.
    """

    sampling_period_s: Annotated[float, Ge(0.001), Le(10.0), MultipleOf(0.001)]
    delay_s: Annotated[float, Ge(0.0), Le(10.0)]


@strict
@dataclass(frozen=True)
class Sensor:
    """One measurement channel: reading = round(truth + bias + noise) to the resolution.

    The noise is normal, cut off at NOISE_CUTOFF standard deviations, so that a bound exists.
    """

    resolution: NonNegative
    noise_std: NonNegative
    bias: Finite

    NOISE_CUTOFF = 4.0

    @property
    def error_bound(self) -> float:
        """Largest absolute error of a reading, in the channel's unit."""
        return abs(self.bias) + self.NOISE_CUTOFF * self.noise_std + 0.5 * self.resolution


@strict
@dataclass(frozen=True)
class Sensors:
    """The five channels of the cell and its coolant, in A, V, K, K and W."""

    current_A: Sensor
    voltage_V: Sensor
    surface_temperature_K: Sensor
    coolant_temperature_K: Sensor
    cooling_power_W: Sensor


@strict
@dataclass(frozen=True)
class Initial:
    """State at plug-in; core, surface and coolant begin at one temperature."""

    soc: Annotated[float, Ge(0), Le(1)]
    temperature_K: Positive
    cooling_power_W: NonNegative


Range = tuple[Finite, Finite]


@strict
@dataclass(frozen=True)
class OperatingBox:
    """Range of each estimator input; training covers it and the estimate is trusted inside only."""

    current_A: Range
    cooling_power_W: Range
    surface_temperature_K: Range
    coolant_temperature_K: Range

    def __post_init__(self) -> None:
        for name, (low, high) in asdict(self).items():
            if not low < high:
                raise InputError(f"operating_box.{name}: must rise from low to high")

    def ranges(self) -> tuple[Range, Range, Range, Range]:
        """The four ranges in the order of the estimator's inputs."""
        return (
            self.current_A,
            self.cooling_power_W,
            self.surface_temperature_K,
            self.coolant_temperature_K,
        )


@strict
@dataclass(frozen=True)
class Preset:
    """A complete, validated scenario for one cell."""

    name: str
    description: str
    sources: tuple[str, ...]
    cell: CellParameters
    limits: Limits
    gains: Gains
    uncertainty: Uncertainty
    timing: Timing
    sensors: Sensors
    initial: Initial
    operating_box: OperatingBox

    def __post_init__(self) -> None:
        low, high = self.operating_box.current_A
        if not low < self.limits.reference_current_A < 0.0 < high:
            raise InputError(
                "operating_box.current_A: must hold both limits.reference_current_A and 0"
            )
        if self.limits.completion_soc > self.limits.max_soc:
            raise InputError("limits.completion_soc: must not exceed limits.max_soc")

    @cached_property
    def hash(self) -> str:
        """SHA-256 of the whole content, as hexadecimal text."""
        return _digest(asdict(self))

    @property
    def training_hash(self) -> str:
        """SHA-256 of what an estimator and its error bound depend on.

        The bound covers the errors of the sensors and full steps of the current, so both belong to
        it as much as cell, uncertainty and box, from which training data are simulated.
        """
        return _digest(
            [
                asdict(self.cell),
                asdict(self.uncertainty),
                asdict(self.operating_box),
                asdict(self.sensors),
                self.limits.reference_current_A,
            ]
        )


def _digest(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
