"""A bench around one ECU: builds its input frames with cantools and reads its output with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cantools.autosar

from bms.firmware import Ecu
from codegen.can_database import data_ids, load_database

DATABASE = load_database()
MEASURED = ("CellElectrical", "CellThermal", "Coolant", "ChargeRequest")
"""What the ECU has to receive."""
RECEIVED = (*MEASURED, "ChargeMode")
"""What it takes, in the order in which it reports how messages fared."""
READY_PERIODS = 3
"""Good periods that make a message valid."""
STATES = ("Init", "Standby", "Charging", "Derated", "Complete", "Fault")


class StepwiseEcu(Ecu):
    """An ECU whose periods go by `receive`, `step` and `transmit`, which a test may replace."""

    def exchange(self, frames: Sequence[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        """A control period by the calls that a subclass replaces."""
        for frame_id, data in frames:
            self.receive(frame_id, data)
        self.step()
        return self.transmit()


HEALTHY: dict[str, float] = {
    "Current": 0.0,
    "Voltage": 3.29,
    "SurfaceTemperature": 299.0,
    "CoolantTemperature": 298.0,
    "CoolingPower": 0.5,
    "Request": 0,
    "ReferenceCurrent": -23.0,
    "PlugInStateOfCharge": 0.5,
}


def frame(name: str, counter: int, values: dict[str, Any]) -> tuple[int, bytes]:
    """Identifier and protected data of a measurement message."""
    message = DATABASE.get_message_by_name(name)
    own = {s.name: values.get(s.name, 0) for s in message.signals}
    own[f"{name}Counter"] = counter % 16
    own[f"{name}Crc"] = 0
    data = message.encode(own, scaling=True, strict=False)
    protected = cantools.autosar.apply_profile2_crc(data, data_ids(message)[counter % 16])
    return message.frame_id, bytes(protected)


@dataclass
class Bench:
    """Sends healthy measurements each period unless a test changes, drops or replaces some.

    ChargeMode, which is optional, comes from the period on in which a test gives a Mode.
    """

    ecu: Ecu = field(default_factory=lambda: Ecu("lin2014"))
    values: dict[str, float] = field(default_factory=lambda: dict(HEALTHY))
    counters: dict[str, int] = field(default_factory=lambda: dict.fromkeys(RECEIVED, 0))
    follow_command: bool = True
    answer: dict[str, Any] = field(default_factory=dict)

    def period(
        self,
        drop: tuple[str, ...] = (),
        replace: dict[str, list[tuple[int, bytes]]] | None = None,
        **changes: float,
    ) -> dict[str, Any]:
        """One control period; returns all signals that the ECU sent, by name."""
        self.values.update(changes)
        for name in RECEIVED if "Mode" in self.values else MEASURED:
            sent = frame(name, self.counters[name], self.values)
            self.counters[name] += 1
            if name in drop:
                continue
            for frame_id, data in (replace or {}).get(name, [sent]):
                self.ecu.receive(frame_id, data)
        self.ecu.step()
        self.answer = {}
        for frame_id, data in self.ecu.transmit():
            message = DATABASE.get_message_by_frame_id(frame_id)
            self.answer |= message.decode(data, decode_choices=False)
        if self.follow_command:
            self.follow()
        return self.answer

    def follow(self) -> None:
        """The charger obeys, and the voltage follows the current."""
        cell = self.ecu.preset.cell
        soc = self.answer["StateOfCharge"] if self.answer["StateOfCharge"] <= 1 else 0.5
        self.values["Current"] = self.answer["CommandCurrent"]
        self.values["Voltage"] = float(
            cell.ocv(soc) - self.values["Current"] * cell.ohmic_resistance_ohm
        )

    def start(self, **changes: float) -> dict[str, Any]:
        """Bring the ECU to charging."""
        self.get_ready(**changes)
        self.period(Request=1)
        return self.period()

    def get_ready(self, **changes: float) -> None:
        """Let the ECU see enough of every message, with the request off."""
        for _ in range(READY_PERIODS):
            self.period(Request=0, **changes)

    def start_at_full_current(self, **changes: float) -> dict[str, Any]:
        """Charging, with the limit on the current's growth behind it."""
        self.start(**changes)
        limits = self.ecu.preset.limits
        growth_A = limits.current_growth_A_per_s * self.ecu.preset.timing.sampling_period_s
        for _ in range(round(-limits.reference_current_A / growth_A)):
            self.period()
        return self.answer

    @property
    def state(self) -> str:
        return STATES[int(self.answer["CommandState"])]

    @property
    def command_A(self) -> float:
        return float(self.answer["CommandCurrent"])

    def latched(self) -> set[int]:
        """Numbers of the latched faults."""
        bits = int(self.answer["LatchedFaults"])
        return {n for n in range(20) if bits >> n & 1}
