"""How the surface of a simulated cell gives its heat to the coolant."""

from __future__ import annotations

from enum import Enum

import numpy as np

from bms.arrays import Array
from bms.cell import CellParameters, CellState

_NOMINAL_DIFFERENCE_K = 5.0
_CONVECTION_EXPONENT = 0.25


class Cooling(Enum):
    """Law of the flow of heat; the names are those of the command line."""

    LINEAR = "linear"
    """The cell model's own: in proportion to the difference of temperature."""
    FREE_CONVECTION = "free-convection"
    """Laminar free convection: the conductance goes with the fourth root of the difference, and is
    the cell's own at 5 K. Source: the classical correlation Nu ~ Ra^(1/4), as in textbooks of heat
    transfer."""

    def excess_W(self, cell: CellParameters, state: CellState) -> Array:
        """Heat from surface to coolant beyond that of the linear law, of the state's shape."""
        difference_K = np.asarray(state.surface_temperature_K - state.coolant_temperature_K)
        if self is Cooling.LINEAR:
            return np.zeros_like(difference_K)
        share = (np.abs(difference_K) / _NOMINAL_DIFFERENCE_K) ** _CONVECTION_EXPONENT
        excess_W: Array = (share - 1.0) * difference_K / cell.surface_resistance_K_per_W
        return excess_W
