"""An ECU in a unit, driven by FMPy as an importer does, in the place of the firmware on a bus."""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import c_double, c_int, c_uint32
from pathlib import Path

from bms.errors import InputError
from hil_sim.fmu.bus_operations import transmit_operations, transmitted_frames
from hil_sim.fmu.unit import Unit

_INTERVAL_CHANGED = 2


class DrivenEcu:
    """The ECU of a unit with one CAN network by FMI-LS-BUS; a BatchEcu.

    Every control period is an event at its time: frames in by Rx_Clock, answers out by Tx_Clock,
    which counts down; then a step of the period's length. Raises InputError for another unit.
    """

    def __init__(self, path: Path, period_s: float, network: str = "Can") -> None:
        self._unit = Unit(path, str(path))
        self._period_s = period_s
        references = []
        for member in ("Rx_Data", "Rx_Clock", "Tx_Data", "Tx_Clock"):
            variable = self._unit.variables.get(f"{network}.{member}")
            if variable is None:
                raise InputError(f"{path}: has no variable {network}.{member}; give an ECU's unit")
            references.append(variable.valueReference)
        self._rx_data, self._rx_clock, self._tx_data, self._tx_clock = references
        self._received: list[tuple[int, bytes]] = []
        self._sent: Sequence[tuple[int, bytes]] = []
        self._unit.instantiate(event_mode=True)
        self._unit.enter_initialization()
        self._unit.initialize()
        self._answers()  # the configuration of the bus
        self._unit.slave.enterStepMode()

    def receive(self, frame_id: int, data: bytes) -> None:
        """Take in a frame by its identifier and data."""
        self._received.append((frame_id, data))

    def step(self) -> None:
        """The event of a control period, and the time until the next."""
        self._sent = self.exchange(self._received)
        self._received = []

    def transmit(self) -> Sequence[tuple[int, bytes]]:
        """Frames of the last step in order."""
        return self._sent

    def exchange(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[tuple[int, bytes]]:
        """Receive frames, step, and return what is transmitted."""
        slave = self._unit.slave
        slave.enterEventMode()
        slave.setClock([self._rx_clock], [True])
        slave.setBinary([self._rx_data], [transmit_operations(frames)])
        slave.updateDiscreteStates()
        answers = self._answers()
        slave.enterStepMode()
        self._unit.step(self._period_s)
        return answers

    def _answers(self) -> Sequence[tuple[int, bytes]]:
        """What the unit sends at this time, once its clock has counted down to it."""
        slave = self._unit.slave
        interval_s, qualifier = (c_double * 1)(), (c_int * 1)()
        slave.getIntervalDecimal((c_uint32 * 1)(self._tx_clock), interval_s, qualifier)
        if qualifier[0] != _INTERVAL_CHANGED or interval_s[0] > 0.0:
            return []
        slave.setClock([self._tx_clock], [True])
        frames = transmitted_frames(slave.getBinary([self._tx_data])[0])
        slave.updateDiscreteStates()
        return frames
