"""Attempts to cross a limit with a cell of the family, through the firmware's own C code.

A state that the observer's claims allow is drawn: a cell anywhere in its intervals or at their
ends, branches with any history, a charger at an end of its tolerance, readings off by up to their
errors. The firmware observes it and decides; the cell model, integrated over the hold, says whether
voltage, core and charge stay where they have to, and whether the observer's claims still hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from bms.barrier.readings import reading_errors
from bms.bus_signals import BUS
from bms.cell import (
    CellFactors,
    CellParameters,
    CellState,
    Disturbance,
    integrate_step,
    polarisation_after_V,
    scaled,
    terminal_voltage_V,
)
from bms.firmware.family_core import FamilyCore, family_reading
from bms.presets import Preset

SAMPLES = 2000
SUB_STEPS = 5
_CORNER_SHARE = 0.5
_ROUNDING_K, _ROUNDING_V = 1e-4, 1e-6


@dataclass(frozen=True)
class Violation:
    """A claim that a simulated hold contradicts, by how much, and the state that it began in."""

    claim: str
    by: float
    state: dict[str, float]


@dataclass
class _Trial:
    """A cell of the family with its true state, and its charger's factor."""

    cell: CellParameters
    state: CellState
    branches_V: tuple[float, ...]
    current_A: float
    supply: float
    cooling_W: float
    noise: Disturbance
    errors: dict[str, float]

    @property
    def voltage_V(self) -> float:
        soc, core_K, *_ = self.state
        return float(terminal_voltage_V(self.cell, soc, self.current_A, core_K, self.branches_V))

    def run(self, time_s: float) -> float:
        """Let time pass at the present current; returns the highest voltage."""
        highest_V = self.voltage_V
        step_s = time_s / SUB_STEPS
        for _ in range(SUB_STEPS):
            self.state = integrate_step(
                self.cell,
                self.state,
                self.current_A,
                self.cooling_W,
                step_s,
                self.noise,
                self.noise,
                self.branches_V,
            )
            self.branches_V = polarisation_after_V(
                self.cell, self.branches_V, self.current_A, step_s
            )
            highest_V = max(highest_V, self.voltage_V)
        return highest_V

    def reading(self, command_A: float) -> Any:
        """What the firmware is told."""
        return family_reading(
            current_A=self.current_A + self.errors["current_A"],
            voltage_V=self.voltage_V + self.errors["voltage_V"],
            surface_temperature_K=self.state.surface_temperature_K + self.errors["surface_K"],
            coolant_temperature_K=self.state.coolant_temperature_K + self.errors["coolant_K"],
            estimated_core_K=float("nan"),
            command_A=command_A,
            is_usable=True,
            is_charging=True,
        )


def search_family(
    preset: Preset, block: Any, samples: int = SAMPLES, seed: int = 0
) -> tuple[Violation, ...]:
    """Violations found in so many one-step trials, the worst of each claim."""
    random = np.random.default_rng(seed)
    worst: dict[str, Violation] = {}
    for _ in range(samples):
        trial = _draw(preset, random)
        for violation in _try_out(preset, block, trial, random):
            known = worst.get(violation.claim)
            if known is None or violation.by > known.by:
                worst[violation.claim] = violation
    return tuple(worst.values())


def _draw(preset: Preset, random: np.random.Generator) -> _Trial:
    interval, limits, box = preset.cell.interval, preset.limits, preset.operating_box
    assert interval is not None
    at_corner = random.uniform() < _CORNER_SHARE

    def within(low: float, high: float) -> float:
        return float(random.choice([low, high]) if at_corner else random.uniform(low, high))

    factors = {
        name: within(*getattr(interval, name))
        for name in (field.name for field in fields(CellFactors))
        if isinstance(getattr(interval, name, None), tuple)
    }
    for name in ("entropic_error_V_per_K", "ocv_error_V"):
        bound = getattr(interval, name)
        factors[name] = within(-bound, bound)
    cell = scaled(preset.cell, CellFactors(**factors))
    strongest_A = -limits.reference_current_A
    strength_A = random.uniform(0.0, strongest_A)
    soc = random.uniform(0.0, 1.0)
    surface_K = random.uniform(box.surface_temperature_K[0], limits.max_core_temperature_K)
    core_K = min(surface_K + random.uniform(-1.0, 25.0), limits.max_core_temperature_K)
    coolant_K = surface_K + random.uniform(-25.0, preset.plug_in.coolant_offset_K)
    noise, share = preset.uncertainty, within(-1.0, 1.0)
    sensors, errors = preset.sensors, reading_errors(preset)
    past_A = random.uniform(0.0, strongest_A)
    return _Trial(
        cell=cell,
        state=CellState(soc, core_K, surface_K, coolant_K),
        branches_V=tuple(
            branch.resistance_ohm * random.uniform(min(strength_A, past_A), max(strength_A, past_A))
            for branch in cell.branches
        ),
        current_A=-strength_A,
        supply=1.0 + within(-preset.supply.tolerance, preset.supply.tolerance),
        cooling_W=float(random.uniform(*box.cooling_power_W)),
        noise=Disturbance(
            0.0,
            share * float(noise.core_at_K_per_s(strength_A)),
            share * noise.surface_K_per_s,
            share * noise.coolant_K_per_s,
        ),
        errors={
            "current_A": within(-1.0, 1.0) * (sensors.current_A.error_bound + BUS.current_A),
            "voltage_V": within(-1.0, 1.0) * (sensors.voltage_V.error_bound + BUS.voltage_V),
            "surface_K": within(-1.0, 1.0) * errors.surface_K,
            "coolant_K": within(-1.0, 1.0) * errors.coolant_K,
        },
    )


def _try_out(
    preset: Preset, block: Any, trial: _Trial, random: np.random.Generator
) -> Iterator[Violation]:
    limits, timing = preset.limits, preset.timing
    begin = {
        "soc": trial.state.soc,
        "core_K": trial.state.core_temperature_K,
        "surface_K": trial.state.surface_temperature_K,
        "coolant_K": trial.state.coolant_temperature_K,
        "current_A": trial.current_A,
        "voltage_V": trial.voltage_V,
    }
    command_A = trial.current_A / trial.supply
    core = _claimed(preset, block, trial, command_A, random)
    family = core.state
    period_s = timing.sampling_period_s
    # A period at the present current, as the observer's last one.
    trial.run(period_s)
    if trial.voltage_V > limits.max_voltage_V:
        return
    reading = trial.reading(command_A)
    core.observe(reading)
    room_K = limits.max_core_temperature_K - trial.state.core_temperature_K
    yield from _broken(
        "core above the observer's bound", family.core_room_K - room_K - _ROUNDING_K, begin
    )
    yield from _broken(
        "charge below its interval", family.soc_low.soc - trial.state.soc - 1e-6, begin
    )
    yield from _broken(
        "charge above its interval", trial.state.soc - family.soc_high.soc - 1e-6, begin
    )
    decided_A = core.decide(reading, limits.reference_current_A)
    if core.is_full(limits.completion_soc):
        yield from _broken(
            "complete too early", limits.completion_soc - trial.state.soc - 1e-4, begin
        )
    trial.run(timing.delay_s)
    # An earlier decision answers for what has happened up to here.
    was_within = trial.voltage_V <= limits.max_voltage_V
    was_cool = trial.state.core_temperature_K <= limits.max_core_temperature_K
    trial.current_A = decided_A * trial.supply
    highest_V = trial.run(period_s)
    if was_within or decided_A < 0.0:
        yield from _broken(
            "voltage above its limit", highest_V - limits.max_voltage_V - _ROUNDING_V, begin
        )
    if was_cool and decided_A < 0.0:
        over_K = trial.state.core_temperature_K - limits.max_core_temperature_K
        yield from _broken("core above its limit", over_K - _ROUNDING_K, begin)


def _claimed(
    preset: Preset, block: Any, trial: _Trial, command_A: float, random: np.random.Generator
) -> FamilyCore:
    """An observer that knows no more than is true: at times all of it, at times much less."""
    limits = preset.limits
    branches = trial.cell.branches
    strengths_A = [
        volts / branch.resistance_ohm for volts, branch in zip(trial.branches_V, branches)
    ] or [-trial.current_A]
    core = FamilyCore(block)
    family = core.state
    loose = random.uniform(0.0, 0.1) * random.integers(0, 2)
    soc = trial.state.soc
    family.soc_low.soc, family.soc_high.soc = max(soc - loose, 0.0), soc + loose
    family.soc_known = True
    for i in range(len(branches)):
        family.strong_A[i] = family.weak_A[i] = strengths_A[i]
    family.polarisation_V = sum(trial.branches_V)
    family.supply_low_A = family.supply_high_A = -command_A
    for i in range(2):
        family.commands_A[i] = -command_A
    core.observe(trial.reading(command_A))
    family.soc_low.soc, family.soc_high.soc = max(soc - loose, 0.0), soc + loose
    family.soc_low.lost = family.soc_high.lost = 0.0
    above_K = random.uniform(0.0, 3.0) * random.integers(0, 2)
    hottest_K = min(trial.state.core_temperature_K + above_K, limits.max_core_temperature_K)
    family.core_room_K = limits.max_core_temperature_K - hottest_K
    family.core_is_known = True
    return core


def _broken(claim: str, by: float, state: dict[str, float]) -> Iterator[Violation]:
    if not by <= 0.0:
        yield Violation(claim, float(by), state)
