"""What a preset holds; the TOML file has these names as keys."""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict, dataclass
from functools import cached_property
from operator import attrgetter
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le, MultipleOf

from bms.cell import CellParameters
from bms.errors import InputError, refuse
from bms.presets.agreement import disagreements
from bms.presets.digest import digest, plain
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
    The surface condition takes the slope of the surface disturbance into account as the paper does,
    or, without assuming one, the disturbance's own worst case in the chain (docs/theory.md).
    Raises InputError unless the surface polynomial is Hurwitz with real roots, because only then
    is the chain dB/dt + lambda B itself a barrier.
    """

    alpha1_per_s: Positive
    alpha3_per_s2: Positive
    alpha4_per_s: Positive
    alpha2_per_s: Positive | None = None
    surface_condition: Literal["paper", "worst-case"] = "paper"
    estimate_error_K: Positive | None = None
    """Error of the estimate that somebody vouches for, for every cell of a family; without one a
    family relies on its observer alone."""

    def __post_init__(self) -> None:
        if self.alpha4_per_s**2 < 4.0 * self.alpha3_per_s2:
            raise InputError(
                "gains: alpha4_per_s^2 must be at least 4 alpha3_per_s2 (real roots); "
                "raise alpha4_per_s or lower alpha3_per_s2"
            )

    @property
    def surface_roots_per_s(self) -> tuple[float, float]:
        """Rates of the surface chain psi = B' + first B, psi' + second psi >= 0, larger first."""
        root = math.sqrt(max(self.alpha4_per_s**2 - 4.0 * self.alpha3_per_s2, 0.0))
        larger_per_s = 0.5 * (self.alpha4_per_s + root)
        return larger_per_s, self.alpha3_per_s2 / larger_per_s

    def core_gain_per_s(self, cell: CellParameters) -> float:
        """The core gain in force in 1/s."""
        if self.alpha2_per_s is not None:
            return self.alpha2_per_s
        return 1.0 / (cell.core_resistance_K_per_W * cell.core_heat_capacity_J_per_K)


@strict
@dataclass(frozen=True)
class Uncertainty:
    """Bounds on the disturbance of each rate, and on the slope of the surface disturbance.

    That of the core may grow with the current u: core + core_per_A |u| + core_per_A2 u^2.
    """

    soc_per_s: NonNegative
    core_K_per_s: NonNegative
    surface_K_per_s: NonNegative
    coolant_K_per_s: NonNegative
    surface_rate_K_per_s2: NonNegative
    core_K_per_As: NonNegative = 0.0
    core_K_per_A2s: NonNegative = 0.0

    def core_at_K_per_s(self, current_A: Any) -> Any:
        """Bound on the core's disturbance in K/s at a current in A; floats or arrays."""
        strength_A = abs(current_A)
        return (
            self.core_K_per_s
            + self.core_K_per_As * strength_A
            + self.core_K_per_A2s * strength_A * strength_A
        )


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


@strict
@dataclass(frozen=True)
class PlugIn:
    """How far the state at plug-in may be from what the charger says, and from rest.

    The coolant may be warmer or colder than the cell by coolant_offset_K, the core warmer than the
    surface by core_excess_K. Branches may hold a polarisation of polarisation_V either way.
    """

    soc_error: NonNegative = 0.0
    coolant_offset_K: NonNegative = 0.0
    core_excess_K: NonNegative = 0.0
    polarisation_V: NonNegative = 0.0


@strict
@dataclass(frozen=True)
class Supply:
    """The charger as it is: its current is a command's times 1 +- tolerance, after a lag."""

    tolerance: Annotated[float, Ge(0.0), Le(0.2)] = 0.0
    lag_s: Annotated[float, Ge(0.0), Le(10.0)] = 0.0


@strict
@dataclass(frozen=True)
class CurrentMap:
    """Strongest charging current over temperature and state of charge, linear between the points.

    A row of `largest_A` belongs to a temperature, a column to a state of charge; beyond the map its
    edge holds. Raises InputError unless the axes rise strictly, and the current does not rise with
    the state of charge nor fall with the temperature: so a cold surface and the fullest possible
    charge are the worst of what is not known exactly.
    """

    temperature_K: tuple[Positive, ...]
    soc: tuple[Finite, ...]
    largest_A: tuple[tuple[NonNegative, ...], ...]

    def __post_init__(self) -> None:
        for name, axis in (("temperature_K", self.temperature_K), ("soc", self.soc)):
            if len(axis) < 2 or not all(low < high for low, high in itertools.pairwise(axis)):
                raise InputError(f"current_map.{name}: must rise strictly, from at least 2 points")
        if len(self.largest_A) != len(self.temperature_K) or any(
            len(row) != len(self.soc) for row in self.largest_A
        ):
            raise InputError(
                "current_map.largest_A: needs a row for each temperature_K, a number for each soc"
            )
        by_soc = (pair for row in self.largest_A for pair in zip(row[1:], row))
        by_temperature = (
            pair
            for colder, warmer in itertools.pairwise(self.largest_A)
            for pair in zip(colder, warmer)
        )
        if not all(low <= high for pairs in (by_soc, by_temperature) for low, high in pairs):
            raise InputError(
                "current_map.largest_A: must not rise along a row nor fall from row to row"
            )


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
        refuse(
            f"operating_box.{name}: must rise from low to high"
            for name, (low, high) in asdict(self).items()
            if not low < high
        )

    def ranges(self) -> tuple[Range, Range, Range, Range]:
        """The four ranges in the order of the estimator's inputs."""
        return (
            self.current_A,
            self.cooling_power_W,
            self.surface_temperature_K,
            self.coolant_temperature_K,
        )


BOX_ABOVE_CORE_LIMIT_K = 3.0
"""By how much the surface's box reaches over the core limit that a bound is made for, at most."""


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
    plug_in: PlugIn = PlugIn()
    supply: Supply = Supply()
    current_map: CurrentMap | None = None

    def __post_init__(self) -> None:
        refuse(disagreements(lambda key: attrgetter(key)(self)))

    @cached_property
    def hash(self) -> str:
        """SHA-256 of the whole content but for what has its default, as hexadecimal text."""
        return digest(self)

    @property
    def training_hash(self) -> str:
        """SHA-256 of what an estimator, its errors and its bound depend on, as hexadecimal text.

        Training and test data are profiles of the thermal model (cell, capacity included, as a
        profile ends when it is full) within the operating box; profiles of the bound's search jump
        to the reference current and count up to `core_limit_of_bound_K`. The bound adds the errors
        of the four sensors that the estimator reads, and the rounding of its filters in each
        sampling period. Nothing of it sees a voltage. The data have a noise of their own instead of
        the preset's uncertainty, and what limits, gains, timing and plug-in state say beyond the
        above is the controller's.
        """
        return digest(self.training_content())

    def training_content(self) -> dict[str, Any]:
        """What `training_hash` is of: tables and keys by their names here."""
        cell, sensors = plain(self.cell), plain(self.sensors)
        del cell["ocv"], sensors["voltage_V"]
        cell.pop("interval", None)
        return {
            "cell": cell,
            "operating_box": self.operating_box,
            "sensors": sensors,
            "reference_current_A": self.limits.reference_current_A,
            "core_limit_of_bound_K": self.core_limit_of_bound_K,
            "sampling_period_s": self.timing.sampling_period_s,
        }

    @property
    def core_limit_of_bound_K(self) -> float:
        """Limit of the core temperature that an estimator's error bound is made for.

        The preset's own, but not much less than what the box allows: so a model stays usable, and
        its bound right, when the limit is lowered, and only then.
        """
        hottest_K = self.operating_box.surface_temperature_K[1]
        return max(self.limits.max_core_temperature_K, hottest_K - BOX_ABOVE_CORE_LIMIT_K)
