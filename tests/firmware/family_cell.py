"""A cell of a family on a bench of its own: the independent oracle of the family's tests.

Written from the physics in docs/family.md and the preset's numbers alone: two thermal masses and
coolant, ohmic resistance over the core's temperature, branches, reversible heat and an open-circuit
voltage that rises steeply beyond full; integrated by the classical Runge-Kutta method. The firmware's
observer and decision run on it as C code.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from bms.firmware._firmware import ffi, lib
from bms.firmware.calibration import calibration_block
from bms.model.pair import load_pair
from bms.presets import Preset, load_preset

SUB_STEPS = 4


@cache
def family_block(preset: str) -> Any:
    """The calibration block of a preset (bms_calibration_t *)."""
    return calibration_block(*load_pair(preset, None), compiled_in=False)


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
        self.branch_ohm = [
            b.resistance_ohm * f for b, f in zip(cell.branches, member.polarisation)
        ]
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

    preset: Preset
    member: Member
    state: list[float]
    around: Surroundings = field(default_factory=Surroundings)
    told_soc: float | None = None
    library: Any = None
    """The compiled firmware (ffi and lib); None for the one that is installed."""

    def __post_init__(self) -> None:
        self.cell = Cell(self.preset, self.member)
        self.block = family_block(self.preset.name)
        self.k, self.rcbf = self.block.family, self.block.rcbf
        self.family = ffi.new("family_t *")
        lib.family_reset(self.family)
        self.time_s, self.period = 0.0, 0
        self.supplied_A = 0.0  # after the lag, before the factor
        self.commands_A = [0.0, 0.0]
        self.is_charging = False
        self.began = False
        self.decision: Any = None
        self.reading: Any = None
        self.highest_V = -math.inf

    @property
    def strength_A(self) -> float:
        return self.supplied_A * self.around.supply_factor

    def _pass(self, time_s: float, command_A: float) -> None:
        step_s = time_s / SUB_STEPS
        if step_s == 0.0:
            return
        lag_s, cell, around, noise = self.around.lag_s, self.cell, self.around, self.preset.uncertainty

        def supplied_A(after_s: float) -> float:
            if lag_s == 0.0:
                return command_A
            return command_A + (begin_A - command_A) * math.exp(-after_s / lag_s)

        for _ in range(SUB_STEPS):
            begin_A = self.supplied_A
            cooling_W = around.cooling_W(self.time_s, self.state)

            def rates(after_s: float, state: Sequence[float]) -> list[float]:
                a = supplied_A(after_s) * around.supply_factor
                disturbance = (
                    around.core_noise(self.time_s) * float(noise.core_at_K_per_s(a)),
                    around.surface_noise(self.time_s) * noise.surface_K_per_s,
                    0.0,
                )
                return cell.rates(state, a, cooling_W, disturbance)

            x = self.state
            self.highest_V = max(
                self.highest_V, cell.voltage_V(x, supplied_A(0.0) * around.supply_factor)
            )
            k1 = rates(0.0, x)
            k2 = rates(0.5 * step_s, [v + 0.5 * step_s * d for v, d in zip(x, k1)])
            k3 = rates(0.5 * step_s, [v + 0.5 * step_s * d for v, d in zip(x, k2)])
            k4 = rates(step_s, [v + step_s * d for v, d in zip(x, k3)])
            self.state = [
                v + step_s / 6.0 * (a + 2.0 * b + 2.0 * c + d)
                for v, a, b, c, d in zip(x, k1, k2, k3, k4)
            ]
            self.supplied_A = supplied_A(step_s)
            self.time_s += step_s
            self.highest_V = max(self.highest_V, cell.voltage_V(self.state, self.strength_A))

    def read(self) -> Any:
        current, voltage, surface, coolant = self.around.errors(self.time_s)
        a = self.strength_A
        self.reading = ffi.new(
            "family_reading_t *",
            {
                "current_A": -a + current * self.k.current_error_A,
                "voltage_V": self.cell.voltage_V(self.state, a) + voltage * self.k.voltage_error_V,
                "surface_temperature_K": self.state[2] + surface * self.k.surface_error_K,
                "coolant_temperature_K": self.state[3] + coolant * self.k.coolant_error_K,
                "estimated_core_K": math.nan,
                "command_A": -self.commands_A[0],
                "is_usable": not self.around.is_lost(self.period),
                "is_charging": self.is_charging,
            },
        )
        return self.reading

    def begin(self, told_soc: float | None = None) -> None:
        """The charge begins with this period's readings."""
        told = self.state[0] if told_soc is None else told_soc
        begin(self, told)
        self.is_charging = True

    def observe(self) -> None:
        self.read()
        lib.family_observe(
            self.family, ffi.addressof(self.k), ffi.addressof(self.rcbf), self.reading
        )

    def decide(self, strongest_A: float | None = None) -> float:
        """Strength that is commanded, within the growth limit."""
        limits = self.preset.limits
        grown_A = self.commands_A[0] + limits.current_growth_A_per_s * self.k.period_s
        wanted_A = min(grown_A, -limits.reference_current_A)
        if strongest_A is not None:
            wanted_A = min(wanted_A, strongest_A)
        self.reading.is_charging = True
        self.decision = lib.family_decide(
            self.family, ffi.addressof(self.k), ffi.addressof(self.rcbf), self.reading, -wanted_A
        )
        return float(-self.decision.current_A)

    def run_period(self, command_A: float) -> None:
        """Let the period pass; the command comes into force after the delay."""
        period_s, delay_s = self.k.period_s, self.around.delay_s
        self._pass(delay_s, self.commands_A[0])
        self._pass(period_s - delay_s, command_A)
        self.commands_A = [command_A, self.commands_A[0]]
        self.period += 1

    @property
    def core_room_K(self) -> float:
        return self.preset.limits.max_core_temperature_K - self.state[1]

    @property
    def is_full(self) -> bool:
        completion = self.preset.limits.completion_soc
        return bool(lib.family_is_full(self.family, ffi.addressof(self.k), completion))


def begin(bench: Bench, told_soc: float) -> None:
    """family_begin with the present readings."""
    lib.family_begin(
        bench.family,
        ffi.addressof(bench.k),
        ffi.addressof(bench.rcbf),
        told_soc,
        bench.reading,
    )


def preset_of(name: str) -> Preset:
    return load_preset(name)
