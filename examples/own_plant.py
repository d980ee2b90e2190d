"""A plant of one's own against `bms ecu`: a cell of one thermal mass in a little coolant.

    bms ecu --bus udp_multicast:239.74.163.9 &
    python examples/own_plant.py udp_multicast:239.74.163.9

A period lasts as long as the ECU needs to answer. Exit code 1 when the charge is not completed.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

from protected_bus import ProtectedBus, open_bus

PERIOD_S = 0.1
START_ATTEMPTS = 60
MOST_PERIODS = 20_000


@dataclass
class Cell:
    """State of charge, and the heat of the current on its way to the coolant; SI units."""

    soc: float = 0.6
    temperature_K: float = 305.0
    coolant_temperature_K: float = 305.0
    cooling_power_W: float = 0.3
    current_A: float = 0.0

    @property
    def voltage_V(self) -> float:
        return 3.19 + 0.15 * self.soc - 0.015 * self.current_A

    def advance(self) -> None:
        passed_on_W = (self.temperature_K - self.coolant_temperature_K) / 4.5
        self.soc -= self.current_A * PERIOD_S / (2.3 * 3600.0)
        self.temperature_K += (0.015 * self.current_A**2 - passed_on_W) * PERIOD_S / 28.0
        self.coolant_temperature_K += (passed_on_W - self.cooling_power_W) * PERIOD_S / 24.0


def exchange(bus: ProtectedBus, cell: Cell, request: str, start_soc: float) -> dict:
    """The signals with which the ECU answers the measurements of a period; none if it is silent."""
    surface_K, coolant_K = cell.temperature_K, cell.coolant_temperature_K
    bus.send("CellElectrical", Current=cell.current_A, Voltage=cell.voltage_V)
    bus.send("CellThermal", SurfaceTemperature=surface_K, CoolantTemperature=coolant_K)
    bus.send("Coolant", CoolingPower=cell.cooling_power_W)
    bus.send("ChargeRequest", Request=request, ReferenceCurrent=-23, PlugInStateOfCharge=start_soc)
    bus.send("SYNC")  # the ECU steps and answers; the charge command is its last message
    answer: dict = {}
    while "CommandCurrent" not in answer and (heard := bus.receive(timeout_s=1.0)) is not None:
        answer |= heard[1]
    return answer


def charge(bus: ProtectedBus, cell: Cell) -> str:
    """Charge until the ECU has completed it or sees a fault; its last state."""
    start_soc, request, state = cell.soc, "Off", "silent"
    if not any(exchange(bus, cell, request, start_soc) for _ in range(START_ATTEMPTS)):
        return state
    for period in range(MOST_PERIODS):
        answer = exchange(bus, cell, request, start_soc)
        cell.current_A = answer.get("CommandCurrent") or 0.0  # no command, no current
        cell.advance()
        state = str(answer.get("CommandState", "silent"))
        request = "Charge" if state == "Standby" else request
        is_over = state in ("Complete", "Fault")
        if is_over or period % 300 == 0:
            print(f"{period * PERIOD_S:.0f} s: {state}, {cell}")
        if is_over:
            break
    return state


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with open_bus(sys.argv[1]) as connection:
        sys.exit(charge(ProtectedBus(connection, "PLANT"), Cell()) != "Complete")
