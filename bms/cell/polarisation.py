"""Voltages of a cell's branches: exact at a constant current, beside the four rates.

A branch of resistance R and time constant tau adds V to the terminal voltage, with

  dV/dt = -V/tau - u R/tau     heat in the core V^2/R

so that charging (u < 0) raises the voltage and, once steady, the heat is R u^2.
"""

from __future__ import annotations

import math
from typing import Any

from bms.cell.parameters import CellParameters

Polarisation = tuple[Any, ...]
"""Voltage of each branch in V."""


def polarisation_after_V(
    cell: CellParameters, polarisation_V: Polarisation, current_A: Any, step_s: float
) -> Polarisation:
    """Voltage of each branch in V after step_s at a constant current in A; floats or arrays."""
    return tuple(
        steady_V + (before_V - steady_V) * math.exp(-step_s / branch.time_constant_s)
        for branch, before_V, steady_V in (
            (branch, before_V, -current_A * branch.resistance_ohm)
            for branch, before_V in zip(cell.branches, polarisation_V, strict=True)
        )
    )


def polarisation_heat_W(cell: CellParameters, polarisation_V: Polarisation) -> Any:
    """Heat of all branches in W; 0 of none."""
    heat_W: Any = 0.0
    for branch, voltage_V in zip(cell.branches, polarisation_V, strict=True):
        heat_W = heat_W + voltage_V * voltage_V / branch.resistance_ohm
    return heat_W


def at_rest_V(cell: CellParameters) -> Polarisation:
    """Voltages of the branches after a long rest: 0 V each."""
    return (0.0,) * len(cell.branches)
