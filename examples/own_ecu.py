"""An ECU of one's own against `bms plant`: CC-CV, derated by the temperature of the surface.

    python examples/own_ecu.py udp_multicast:239.74.163.8 &
    bms plant --bus udp_multicast:239.74.163.8

Ends when the bus has been silent for SILENCE_S.
"""

from __future__ import annotations

import sys

from protected_bus import ProtectedBus, open_bus

SILENCE_S = 5.0
START_S = 60.0
CHARGE_VOLTAGE_V = 3.5
RESISTANCE_OHM = 0.0125
DERATED_FROM_K, ZERO_FROM_K = 310.0, 320.0
CUT_OFF_A = -1.15
INPUTS = ("CellElectrical", "CellThermal", "Coolant", "ChargeRequest")


class Controller:
    """One charge after the other; each begins when the request goes from off to charge."""

    def __init__(self) -> None:
        self.state = "Init"

    def step(self, heard: dict[str, dict]) -> float:
        """Current in A for what a period's messages say; 0 A unless all of them have come."""
        readings = {key: value for message in heard.values() for key, value in message.items()}
        if any(name not in heard for name in INPUTS) or None in readings.values():
            return 0.0
        if readings["Request"] != "Charge":
            self.state = "Standby"
        elif self.state == "Standby":
            self.state = "Charging"
        if self.state not in ("Charging", "Derated"):
            return 0.0
        current_A = self.allowed_A(readings)
        self.state = "Derated" if current_A > readings["ReferenceCurrent"] else "Charging"
        is_at_voltage = readings["Voltage"] >= CHARGE_VOLTAGE_V - 0.01
        if is_at_voltage and current_A > CUT_OFF_A:
            self.state = "Complete"
            return 0.0
        return current_A

    def allowed_A(self, readings: dict) -> float:
        """The weakest of what is asked for, what the voltage allows, what the surface allows."""
        headroom_V = CHARGE_VOLTAGE_V - readings["Voltage"]
        by_voltage_A = readings["Current"] - headroom_V / RESISTANCE_OHM
        share = (ZERO_FROM_K - readings["SurfaceTemperature"]) / (ZERO_FROM_K - DERATED_FROM_K)
        by_surface_A = readings["ReferenceCurrent"] * min(max(share, 0.0), 1.0)
        return min(max(by_voltage_A, by_surface_A), 0.0)


def answer(bus: ProtectedBus) -> None:
    """Answer every SYNC with a charge command."""
    controller, heard, timeout_s = Controller(), {}, START_S
    while (message := bus.receive(timeout_s)) is not None:
        name, values = message
        timeout_s = SILENCE_S
        if name != "SYNC":
            heard[name] = values
            continue
        current_A = controller.step(heard)
        heard = {}  # what does not come again in the next period is missing
        bus.send("ChargeCommand", CommandCurrent=current_A, CommandState=controller.state)
    print(f"silence; last state {controller.state}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with open_bus(sys.argv[1]) as connection:
        answer(ProtectedBus(connection, "ECU"))
