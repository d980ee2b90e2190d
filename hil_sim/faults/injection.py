"""The faults of one run: tells each when to act, and keeps a record of when it did."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bms.cell import CellState
from hil_sim.bus.buses import Frame
from hil_sim.bus.database import MessageCodec
from hil_sim.faults.base import Fault
from hil_sim.faults.clocks import ClockJitter
from hil_sim.faults.ecu import EcuRestarted, RestartableEcu
from hil_sim.faults.frames import FrameFault, FrameMemory
from hil_sim.faults.plant import ChargerFault, PumpFailed
from hil_sim.faults.sensors import SensorFault, SensorMemory
from hil_sim.nodes.clock import Clock, WallClock
from hil_sim.nodes.ecu import EcuLike
from hil_sim.plant.seam import PlantLike
from hil_sim.plant.sensors import Readings


@dataclass(frozen=True)
class InjectedFault:
    """When a fault acted, in s from the start of the charge; no end when it still did."""

    kind: str
    where: str
    begin_s: float
    end_s: float | None


class Injection:
    """Where the faults of a run act. Without faults everything passes as it is.

    `begin` opens every period; the other methods are the places where faults act in it.
    """

    def __init__(
        self,
        faults: Sequence[Fault],
        period_s: float,
        seed: np.random.SeedSequence,
        database: Mapping[str, MessageCodec],
        clock: Clock | None = None,
    ) -> None:
        self._period_s = period_s
        self._clock = clock or WallClock()
        self._windows = [(fault, fault.window(period_s)) for fault in faults]
        self._active: set[int] = set()
        self._begun: dict[int, tuple[float, float | None]] = {}
        self._healthy_power_W: float | None = None
        rngs = [np.random.default_rng(child) for child in seed.spawn(len(faults))]
        self._frames = [
            (n, fault, FrameMemory(database, rng))
            for n, (fault, rng) in enumerate(zip(faults, rngs))
            if isinstance(fault, FrameFault)
        ]
        self._sensors = [
            (n, fault, SensorMemory(rng))
            for n, (fault, rng) in enumerate(zip(faults, rngs))
            if isinstance(fault, SensorFault)
        ]
        self._jitter = [
            (n, fault, rng)
            for n, (fault, rng) in enumerate(zip(faults, rngs))
            if isinstance(fault, ClockJitter)
        ]

    def begin(self, charge_period: int | None, plant: PlantLike) -> None:
        """Open a period: its number since the start of the charge, None before that."""
        if not self._windows:
            return
        for n, (_, window) in enumerate(self._windows):
            if charge_period is None:
                continue
            if charge_period in window:
                if n not in self._active:
                    self._active.add(n)
                    self._begun[n] = (self._time_s(charge_period), None)
            elif n in self._active:
                self._active.remove(n)
                self._begun[n] = (self._begun[n][0], self._time_s(charge_period))
        self._set_pump(plant)
        for n, fault, rng in self._jitter:
            if n in self._active:
                fault.wait(self._clock, rng)

    def sent(self, frames: list[Frame]) -> list[Frame]:
        """What of the plant's frames arrives at the ECU."""
        for n, fault, memory in self._frames:
            frames = fault.apply(frames, n in self._active, memory)
        return frames

    def heard(self, frames: list[Frame]) -> list[Frame]:
        """What of the ECU's frames arrives at the plant."""
        for n, fault, memory in self._frames:
            if fault.hits_what_ecu_sends:
                frames = fault.apply(frames, n in self._active, memory)
        return frames

    def readings(self, healthy: Readings, truth: CellState) -> Readings:
        """What the sensors say in place of what they should."""
        if not self._windows:
            return healthy
        readings = healthy._asdict()
        if self._healthy_power_W is not None and self._is_active(_is_hidden_pump_failure):
            readings["cooling_power_W"] += self._healthy_power_W
        for n, fault, memory in self._sensors:
            value = readings[fault.sensor]
            if n in self._active:
                readings[fault.sensor] = fault.reading(value, truth, memory)
                memory.age_s += self._period_s
            else:
                memory.last_healthy = value
        return Readings(**readings)

    def supplied_A(self, obedient_A: float, last_A: float) -> float:
        """Current of the coming period in A in place of the one that the charger's rule gives."""
        current_A = obedient_A
        for n, (fault, _) in enumerate(self._windows):
            if isinstance(fault, ChargerFault) and n in self._active:
                current_A = fault.current_A(current_A, last_A)
        return current_A

    def ecu(self, make: Callable[[], EcuLike]) -> EcuLike:
        """The ECU, able to restart when there is a fault that makes it."""
        if not any(isinstance(fault, EcuRestarted) for fault, _ in self._windows):
            return make()
        return RestartableEcu(
            make, lambda: self._is_active(lambda fault: isinstance(fault, EcuRestarted))
        )

    @property
    def injected(self) -> tuple[InjectedFault, ...]:
        """The faults that have acted so far, in the order of the file."""
        return tuple(
            InjectedFault(fault.kind, fault.where, *self._begun[n])
            for n, (fault, _) in enumerate(self._windows)
            if n in self._begun
        )

    def _time_s(self, charge_period: int) -> float:
        return round(charge_period * self._period_s, 9)

    def _is_active(self, condition: Callable[[Fault], bool]) -> bool:
        return any(condition(self._windows[n][0]) for n in self._active)

    def _set_pump(self, plant: PlantLike) -> None:
        has_failed = self._is_active(lambda fault: isinstance(fault, PumpFailed))
        if has_failed and self._healthy_power_W is None:
            self._healthy_power_W, plant.cooling_power_W = plant.cooling_power_W, 0.0
        elif not has_failed and self._healthy_power_W is not None:
            plant.cooling_power_W, self._healthy_power_W = self._healthy_power_W, None


def _is_hidden_pump_failure(fault: Fault) -> bool:
    return isinstance(fault, PumpFailed) and fault.reported == "healthy"
