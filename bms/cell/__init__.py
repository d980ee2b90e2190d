"""The electro-thermal cell: parameters, equations, integration."""

from bms.cell.integrator import integrate_step
from bms.cell.interval import CellInterval
from bms.cell.model import (
    CellState,
    Disturbance,
    ohmic_resistance_ohm,
    rates,
    terminal_voltage_V,
)
from bms.cell.parameters import CellParameters, OpenCircuitVoltage
from bms.cell.polarisation import Polarisation, at_rest_V, polarisation_after_V
from bms.cell.scaling import CellFactors, scaled
from bms.cell.tables import Branch, EntropyTable, ResistanceTable

__all__ = [
    "Branch",
    "CellFactors",
    "CellInterval",
    "CellParameters",
    "CellState",
    "Disturbance",
    "EntropyTable",
    "OpenCircuitVoltage",
    "Polarisation",
    "ResistanceTable",
    "at_rest_V",
    "integrate_step",
    "ohmic_resistance_ohm",
    "polarisation_after_V",
    "rates",
    "scaled",
    "terminal_voltage_V",
]
