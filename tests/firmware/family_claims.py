"""What a family's firmware claims of a charge, held against the cell that is charged."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

from tests.firmware.family_cell import Bench, FamilyCode, Member, Surroundings

REST_S = 2.5
"""Until the rest has told the core temperature."""
ROUNDING_SOC, ROUNDING_K, ROUNDING_V = 2e-6, 1e-4, 1e-5


@dataclass(frozen=True)
class Start:
    """A cell as it is plugged in; the coolant and the core are given as their excess."""

    soc: float = 0.5
    surface_K: float = 298.0
    core_excess_K: float = 0.0
    coolant_excess_K: float = 0.0
    branches_V: tuple[float, float] = (0.0, 0.0)
    told_error: float = 0.0

    def state(self) -> list[float]:
        core_K, coolant_K = (
            self.surface_K + self.core_excess_K,
            self.surface_K + self.coolant_excess_K,
        )
        return [self.soc, core_K, self.surface_K, coolant_K, *self.branches_V]


def charge(
    code: FamilyCode,
    member: Member,
    start: Start,
    around: Surroundings,
    time_s: float,
    strongest_A: float = math.inf,
    pauses: tuple[tuple[float, float], ...] = (),
    is_core_told: bool = False,
) -> dict[str, float]:
    """Worst excess by claim: all are at most 0 where the claims hold.

    In a pause, given by its beginning and its length in s, nothing is commanded; after it a new
    charge begins with a new state of charge from the charger. With is_core_told the observer begins
    with the true core temperature, as if rest had told it without an error.
    """
    bench = Bench(code, member, start.state(), around)
    limits = code.preset.limits
    worst: dict[str, float] = {}

    def hold(claim: str, excess: float) -> None:
        worst[claim] = max(worst.get(claim, -math.inf), math.inf if math.isnan(excess) else excess)

    waits = [*pauses, (math.inf, 0.0)]
    ready_s = REST_S
    while bench.time_s < time_s:
        bench.highest_V = -math.inf
        bench.observe()
        family, usable = bench.family, bench.reading.is_usable
        if bench.time_s > waits[0][0]:
            ready_s, bench.is_charging = bench.time_s + waits.pop(0)[1], False
        if not bench.is_charging and usable and bench.time_s >= ready_s:
            bench.begin(min(max(bench.state[0] + start.told_error, 0.0), 1.0))
        if is_core_told and family.core_is_known:
            family.core_room_K, is_core_told = bench.core_room_K, False
        if family.soc_known:
            hold("charge is no less", family.soc_low.soc - bench.state[0] - ROUNDING_SOC)
            hold("charge is no more", bench.state[0] - family.soc_high.soc - ROUNDING_SOC)
        if family.core_is_known:
            hold("core is no hotter", family.core_room_K - bench.core_room_K - ROUNDING_K)
        command_A = 0.0
        if bench.is_charging:
            if bench.is_full:
                hold("full is full", limits.completion_soc - bench.state[0] - ROUNDING_SOC)
                break
            if usable:
                hold("readings are plausible", float(not plausible(bench)) - 0.5)
                command_A = bench.decide(strongest_A)
        bench.run_period(command_A)
        hold("voltage", bench.highest_V - limits.max_voltage_V - ROUNDING_V)
        hold("core", bench.state[1] - limits.max_core_temperature_K)
        hold("surface", bench.state[2] - limits.max_surface_temperature_K)
        hold("overfilled", bench.state[0] - 1.005)
    return worst


def plausible(bench: Bench) -> bool:
    """Whether the firmware believes current and voltage, to within the readings' own errors."""
    code, k, reading = bench.code, bench.k, bench.reading
    current_A, voltage_V = k.current_error_A + 1e-4, k.voltage_error_V + 1e-4
    return bool(
        code.lib.family_supply_is_plausible(bench.family, k, reading.current_A, current_A)
        and code.lib.family_voltage_is_plausible(bench.family, k, code.cell, reading, voltage_V)
    )


def broken(worst: dict[str, float]) -> dict[str, float]:
    return {claim: excess for claim, excess in worst.items() if not excess <= 0.0}


def random_member(code: FamilyCode, draw: random.Random) -> Member:
    """A cell at the ends of its intervals, or anywhere in them."""
    interval = code.preset.cell.interval
    assert interval is not None
    at_ends = draw.random() < 0.7

    def within(ends: tuple[float, float]) -> float:
        return draw.choice(ends) if at_ends else draw.uniform(*ends)

    longest_s = max(branch.time_constant_s for branch in code.preset.cell.branches)
    factor = interval.longest_relaxation_s / longest_s
    error_V, error_V_per_K = interval.ocv_error_V, interval.entropic_error_V_per_K
    return Member(
        core_resistance=within(interval.core_resistance),
        core_heat_capacity=within(interval.core_heat_capacity),
        surface_resistance=within(interval.surface_resistance),
        surface_heat_capacity=within(interval.surface_heat_capacity),
        coolant_heat_capacity=within(interval.coolant_heat_capacity),
        resistance=within(interval.resistance),
        polarisation=(within(interval.polarisation), within(interval.polarisation)),
        relaxation=(within((1.0 / factor, factor)), within((1.0 / factor, factor))),
        capacity=within(interval.capacity),
        entropic_error_V_per_K=within((-error_V_per_K, error_V_per_K)),
        ocv_error_V=within((-error_V, error_V)),
    )


def switching(draw: random.Random) -> Callable[[float], float]:
    """-1 or 1, for good or changing at random."""
    every_s = draw.choice([0.1, 1.0, 10.0, 1e6])
    signs = [draw.choice([-1.0, 1.0]) for _ in range(997)]
    return lambda time_s: signs[int(time_s / every_s + 1e-6) % len(signs)]


def random_surroundings(draw: random.Random, lost_share: float = 0.0) -> Surroundings:
    """Sensors, disturbances and charger at their bounds; a cooler with a thermostat."""
    errors = [switching(draw) for _ in range(4)]
    core, surface = switching(draw), switching(draw)
    cooling_W, every_s = draw.choice([0.0, 1.0, 3.0]), draw.choice([3.0, 30.0, 1e6])
    lost = [draw.random() < lost_share for _ in range(997)]

    def cooling(time_s: float, state: object) -> float:
        coolant_K = state[3]  # type: ignore[index]
        if coolant_K > 320.0 or coolant_K < 266.0:
            return 3.0 if coolant_K > 320.0 else 0.0
        return cooling_W if int(time_s / every_s) % 2 == 0 else 0.0

    return Surroundings(
        cooling_W=cooling,
        core_noise=core,
        surface_noise=surface,
        errors=lambda time_s: (
            errors[0](time_s),
            errors[1](time_s),
            errors[2](time_s),
            errors[3](time_s),
        ),
        is_lost=lambda period: lost[period % len(lost)],
        supply_factor=draw.choice([0.95, 1.0, 1.05]),
        lag_s=draw.choice([0.0, 0.3, 1.0]),
        delay_s=draw.choice([0.0, 0.05, 0.1]),
    )
