"""The electro-thermal cell: parameters, equations, integration."""

from bms.cell.integrator import integrate_step
from bms.cell.interval import CellInterval
from bms.cell.model import CellState, Disturbance, rates, terminal_voltage_V
from bms.cell.parameters import CellParameters, OpenCircuitVoltage
from bms.cell.tables import Branch, EntropyTable, ResistanceTable

__all__ = [
    "Branch",
    "CellInterval",
    "CellParameters",
    "CellState",
    "Disturbance",
    "EntropyTable",
    "OpenCircuitVoltage",
    "ResistanceTable",
    "integrate_step",
    "rates",
    "terminal_voltage_V",
]
