"""The electro-thermal cell: parameters, equations, integration."""

from bms.cell.integrator import integrate_step
from bms.cell.model import CellState, Disturbance, rates, terminal_voltage_V
from bms.cell.parameters import CellParameters, OpenCircuitVoltage

__all__ = [
    "CellParameters",
    "CellState",
    "Disturbance",
    "OpenCircuitVoltage",
    "integrate_step",
    "rates",
    "terminal_voltage_V",
]
