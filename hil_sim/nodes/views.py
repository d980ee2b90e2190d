"""What a Python controller in the ECU's place gets to see of the cell."""

from __future__ import annotations

import math
from typing import Protocol

from bms.decision import Observation
from bms.presets import Preset
from hil_sim.bus.catalog import Message
from hil_sim.bus.database import MessageCodec
from hil_sim.bus.e2e import Receiver
from hil_sim.plant.seam import PlantLike


class View(Protocol):
    """A source of observations, asked once a control period."""

    def receive(self, frame_id: int, data: bytes) -> None:
        """Take in a frame from the bus."""

    def begin(self, plug_in_soc: float) -> None:
        """A charge begins at this state of charge."""

    def observe(self, reference_current_A: float) -> Observation:
        """What is seen in this period, NaN for what is not."""
        ...


class TrueState:
    """The state of the simulated cell itself, for methods that assume it is known."""

    def __init__(self, plant: PlantLike) -> None:
        self._plant = plant

    def receive(self, frame_id: int, data: bytes) -> None:
        """Ignore the frame: this view does not depend on the bus."""

    def begin(self, plug_in_soc: float) -> None:
        """Do nothing: the true state of charge is known."""

    def observe(self, reference_current_A: float) -> Observation:
        """The true state at the start of this period."""
        plant = self._plant
        return Observation(*plant.state, plant.cooling_power_W, reference_current_A)


class BusMeasurements:
    """The measurements on the bus, and charge counted from them; the core stays unknown."""

    _NEEDED = (Message.CELL_ELECTRICAL, Message.CELL_THERMAL, Message.COOLANT)

    def __init__(self, preset: Preset, database: dict[str, MessageCodec]) -> None:
        self._change_per_A = preset.timing.sampling_period_s / preset.cell.capacity_As
        self._receivers = {
            database[name].frame_id: Receiver(database[name]) for name in self._NEEDED
        }
        self._readings: dict[str, float] = {}
        self._soc = math.nan

    def receive(self, frame_id: int, data: bytes) -> None:
        """Take in a measurement; what is corrupt or not available is missing."""
        receiver = self._receivers.get(frame_id)
        values = receiver.accept(data) if receiver is not None else None
        for name, value in (values or {}).items():
            if value is not None:
                self._readings[name] = value

    def begin(self, plug_in_soc: float) -> None:
        """Count charge from this state of charge on."""
        self._soc = plug_in_soc

    def observe(self, reference_current_A: float) -> Observation:
        """Readings of this period; the measured current is what flowed since the last one."""
        readings, self._readings = self._readings, {}
        self._soc -= readings.get("Current", 0.0) * self._change_per_A
        return Observation(
            soc=self._soc,
            core_temperature_K=math.nan,
            surface_temperature_K=readings.get("SurfaceTemperature", math.nan),
            coolant_temperature_K=readings.get("CoolantTemperature", math.nan),
            cooling_power_W=readings.get("CoolingPower", math.nan),
            reference_current_A=reference_current_A,
            voltage_V=readings.get("Voltage", math.nan),
            current_A=readings.get("Current", math.nan),
        )
