"""A cell of a family on a bench of its own: the independent oracle of the family's tests.

Written from the physics in docs/family.md and the preset's numbers alone: two thermal masses and
coolant, ohmic resistance over the core's temperature, branches, reversible heat and an open-circuit
voltage that rises steeply beyond full; integrated by the classical Runge-Kutta method. Observer and
decision run on it as C code.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cffi import FFI

from bms.calibration import calibration_fields
from bms.model.pair import load_pair
from bms.presets import Preset
from tests.firmware.native_library import FIRMWARE, load_library

SUB_STEPS = 4
SOURCES = [
    FIRMWARE / "src" / f"{name}.c"
    for name in (
        *("rcbf", "soc", "family_tables", "family_begin", "family_observer"),
        *("family_plausibility", "family_windows", "family_decision"),
    )
]
HEADERS = ["include/rcbf.h", "include/soc.h", "include/family.h", "src/family_tables.h"]


@dataclass(frozen=True)
class FamilyCode:
    """The C code of a family, and the constants of a preset for it."""

    preset: Preset
    ffi: FFI
    lib: Any
    k: Any
    """family_constants_t *"""
    cell: Any
    """rcbf_constants_t *"""

    def of(self, preset: str) -> FamilyCode:
        """The same code with the constants of another preset."""
        return with_constants(preset, self.ffi, self.lib)

    def reading(self, **values: Any) -> Any:
        """family_reading_t * of a cell at rest at 298 K, but for the values given."""
        at_rest = {
            "current_A": 0.0,
            "voltage_V": 3.30,
            "surface_temperature_K": 298.0,
            "coolant_temperature_K": 298.0,
            "estimated_core_K": math.nan,
            "command_A": 0.0,
            "is_usable": True,
            "is_charging": True,
        }
        return self.ffi.new("family_reading_t *", {**at_rest, **values})

    def observer(self) -> Any:
        """family_t * that knows nothing."""
        family = self.ffi.new("family_t *")
        self.lib.family_reset(family, self.k)
        return family

    def begin(self, family: Any, told_soc: float, reading: Any) -> None:
        self.lib.family_begin(family, self.k, self.cell, told_soc, reading)

    def observe(self, family: Any, reading: Any) -> None:
        self.lib.family_observe(family, self.k, self.cell, reading)

    def decide(self, family: Any, reading: Any, asked_A: float) -> Any:
        """Decision on a strength that is asked for."""
        return self.lib.family_decide(family, self.k, self.cell, reading, -asked_A)


def family_code(
    out: Path, preset: str = "a123_26650_10C", change: tuple[str, str, str] | None = None
) -> FamilyCode:
    """Compile the family's sources, perhaps with one of them changed (file, old, new)."""
    return with_constants(preset, *load_library(out, SOURCES, HEADERS, change))


def with_constants(preset: str, ffi: FFI, lib: Any) -> FamilyCode:
    loaded, model = load_pair(preset, None)
    fields = calibration_fields(loaded, model)
    constants = ffi.new("family_constants_t *", fields["family"])
    return FamilyCode(loaded, ffi, lib, constants, ffi.new("rcbf_constants_t *", fields["rcbf"]))


def _interpolated(points: Sequence[float], values: Sequence[float], at: float) -> float:
    i = min(max(bisect_right(points, at) - 1, 0), len(points) - 2) if len(points) > 1 else 0
    if len(points) == 1 or at <= points[0]:
        return values[0]
    if at >= points[-1]:
        return values[-1]
    share = (at - points[i]) / (points[i + 1] - points[i])
    return values[i] + share * (values[i + 1] - values[i])


@dataclass(frozen=True)
class Member:
    """Where in each interval of `cell.interval` a cell lies: factors, and errors of tables."""

    core_resistance: float = 1.0
    core_heat_capacity: float = 1.0
    surface_resistance: float = 1.0
    surface_heat_capacity: float = 1.0
    coolant_heat_capacity: float = 1.0
    resistance: float = 1.0
    polarisation: tuple[float, ...] = (1.0, 1.0)
    relaxation: tuple[float, ...] = (1.0, 1.0)
    """Factors of the branches' resistances and time constants."""
    capacity: float = 1.0
    entropic_error_V_per_K: float = 0.0
    ocv_error_V: float = 0.0


class Cell:
    """True state of a member: charge, three temperatures, branches' voltages."""

    def __init__(self, preset: Preset, member: Member) -> None:
        cell = preset.cell
        self.rc = cell.core_resistance_K_per_W * member.core_resistance
        self.cc = cell.core_heat_capacity_J_per_K * member.core_heat_capacity
        self.rs = cell.surface_resistance_K_per_W * member.surface_resistance
        self.cs = cell.surface_heat_capacity_J_per_K * member.surface_heat_capacity
        self.cinf = cell.coolant_heat_capacity_J_per_K * member.coolant_heat_capacity
        self.capacity_As = cell.capacity_As * member.capacity
        self.member = member
        assert cell.resistance is not None and cell.entropy is not None
        self._ohm = [row[0] * member.resistance for row in cell.resistance.ohm]
        self._ohm_K = list(cell.resistance.temperature_K)
        self._entropy = cell.entropy
        self._ocv = cell.ocv
        self.branch_ohm = [b.resistance_ohm * f for b, f in zip(cell.branches, member.polarisation)]
        self.branch_s = [b.time_constant_s * f for b, f in zip(cell.branches, member.relaxation)]

    def resistance_ohm(self, core_K: float) -> float:
        return _interpolated(self._ohm_K, self._ohm, core_K)

    def ocv_V(self, soc: float) -> float:
        ocv = self._ocv
        over_V = max(soc - 1.0, 0.0) * ocv.overfill_slope_V
        return _interpolated(ocv.soc, ocv.voltage_V, soc) + over_V + self.member.ocv_error_V

    def entropic_V_per_K(self, soc: float) -> float:
        return (
            _interpolated(self._entropy.soc, self._entropy.V_per_K, soc)
            + self.member.entropic_error_V_per_K
        )

    def voltage_V(self, state: Sequence[float], strength_A: float) -> float:
        soc, core_K, _, _, *branches_V = state
        return self.ocv_V(soc) + self.resistance_ohm(core_K) * strength_A + sum(branches_V)

    def heat_W(self, state: Sequence[float], strength_A: float) -> float:
        """Irreversible heat."""
        _, core_K, _, _, *branches_V = state
        return self.resistance_ohm(core_K) * strength_A**2 + sum(
            volts**2 / ohm for volts, ohm in zip(branches_V, self.branch_ohm) if ohm > 0.0
        )

    def rates(
        self,
        state: Sequence[float],
        strength_A: float,
        cooling_W: float,
        noise_K_per_s: tuple[float, float, float],
    ) -> list[float]:
        soc, core_K, surface_K, coolant_K, *branches_V = state
        inner_W = (core_K - surface_K) / self.rc
        outer_W = (surface_K - coolant_K) / self.rs
        heat_W = self.heat_W(state, strength_A)
        heat_W += strength_A * self.entropic_V_per_K(soc) * core_K
        return [
            strength_A / self.capacity_As,
            (heat_W - inner_W) / self.cc + noise_K_per_s[0],
            (inner_W - outer_W) / self.cs + noise_K_per_s[1],
            (outer_W - cooling_W) / self.cinf + noise_K_per_s[2],
            *(
                (ohm * strength_A - volts) / seconds
                for ohm, seconds, volts in zip(self.branch_ohm, self.branch_s, branches_V)
            ),
        ]


@dataclass
class Surroundings:
    """What acts on cell, charger and sensors; a test lets them be as bad as they may."""

    cooling_W: Callable[[float, Sequence[float]], float] = lambda time_s, state: 0.0
    core_noise: Callable[[float], float] = lambda time_s: 0.0
    surface_noise: Callable[[float], float] = lambda time_s: 0.0
    """Shares, -1 to 1, of the largest disturbances."""
    errors: Callable[[float], tuple[float, float, float, float]] = lambda time_s: (0.0,) * 4
    """Shares of the largest errors of current, voltage, surface and coolant readings."""
    is_lost: Callable[[int], bool] = lambda period: False
    supply_factor: float = 1.0
    lag_s: float = 0.0
    delay_s: float = 0.1


@dataclass
class Bench:
    """Cell, charger and the firmware's observer and decision, period by period."""

    code: FamilyCode
    member: Member
    state: list[float]
    around: Surroundings = field(default_factory=Surroundings)

    def __post_init__(self) -> None:
        self.preset, self.k = self.code.preset, self.code.k
        self.cell = Cell(self.preset, self.member)
        self.family = self.code.observer()
        self.time_s, self.period = 0.0, 0
        self.supplied_A = 0.0
        """After the lag, before the factor."""
        self.commands_A = [0.0, 0.0]
        self.is_charging = False
        self.reading: Any = None
        self.decision: Any = None
        self.highest_V = -math.inf

    @property
    def strength_A(self) -> float:
        return self.supplied_A * self.around.supply_factor

    @property
    def voltage_V(self) -> float:
        return self.cell.voltage_V(self.state, self.strength_A)

    @property
    def core_room_K(self) -> float:
        return self.preset.limits.max_core_temperature_K - self.state[1]

    @property
    def is_full(self) -> bool:
        completion = self.preset.limits.completion_soc
        return bool(self.code.lib.family_is_full(self.family, self.k, completion))

    def observe(self) -> None:
        """Take the readings of this period."""
        current, voltage, surface, coolant = self.around.errors(self.time_s)
        self.reading = self.code.reading(
            current_A=-self.strength_A + current * self.k.current_error_A,
            voltage_V=self.voltage_V + voltage * self.k.voltage_error_V,
            surface_temperature_K=self.state[2] + surface * self.k.surface_error_K,
            coolant_temperature_K=self.state[3] + coolant * self.k.coolant_error_K,
            command_A=-self.commands_A[0],
            is_usable=not self.around.is_lost(self.period),
            is_charging=self.is_charging,
        )
        self.code.observe(self.family, self.reading)

    def begin(self, told_soc: float | None = None) -> None:
        """The charge begins with this period's readings."""
        self.code.begin(self.family, self.state[0] if told_soc is None else told_soc, self.reading)
        self.is_charging = self.reading.is_charging = True

    def decide(self, strongest_A: float = math.inf) -> float:
        """Strength that is commanded, within the growth limit; 0 without usable readings."""
        limits = self.preset.limits
        grown_A = self.commands_A[0] + limits.current_growth_A_per_s * self.k.period_s
        wanted_A = min(grown_A, -limits.reference_current_A, strongest_A)
        self.decision = self.code.decide(self.family, self.reading, wanted_A)
        return float(-self.decision.current_A)

    def run_period(self, command_A: float) -> None:
        """Let the period pass; the command comes into force after the delay."""
        self._pass(self.around.delay_s, self.commands_A[0])
        self._pass(self.k.period_s - self.around.delay_s, command_A)
        self.commands_A = [command_A, self.commands_A[0]]
        self.period += 1

    def _pass(self, time_s: float, command_A: float) -> None:
        if time_s <= 0.0:
            return
        step_s = time_s / SUB_STEPS
        self.highest_V = max(self.highest_V, self.voltage_V)
        for _ in range(SUB_STEPS):
            self._step(step_s, command_A)
            self.highest_V = max(self.highest_V, self.voltage_V)

    def _step(self, step_s: float, command_A: float) -> None:
        around, noise, start_A = self.around, self.preset.uncertainty, self.supplied_A
        cooling_W = around.cooling_W(self.time_s, self.state)
        core_share, surface_share = (
            around.core_noise(self.time_s),
            around.surface_noise(self.time_s),
        )

        def supplied_A(after_s: float) -> float:
            left = math.exp(-after_s / around.lag_s) if around.lag_s > 0.0 else 0.0
            return command_A + (start_A - command_A) * left

        def rates(after_s: float, state: Sequence[float]) -> list[float]:
            strength_A = supplied_A(after_s) * around.supply_factor
            core_K_per_s = core_share * float(noise.core_at_K_per_s(strength_A))
            disturbance = (core_K_per_s, surface_share * noise.surface_K_per_s, 0.0)
            return self.cell.rates(state, strength_A, cooling_W, disturbance)

        def moved(rate: Sequence[float], by_s: float) -> list[float]:
            return [value + by_s * change for value, change in zip(self.state, rate)]

        first = rates(0.0, self.state)
        second = rates(0.5 * step_s, moved(first, 0.5 * step_s))
        third = rates(0.5 * step_s, moved(second, 0.5 * step_s))
        fourth = rates(step_s, moved(third, step_s))
        mean = [
            (a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(first, second, third, fourth)
        ]
        self.state = moved(mean, step_s)
        self.supplied_A = supplied_A(step_s)
        self.time_s += step_s
