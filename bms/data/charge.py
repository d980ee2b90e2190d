"""State of charge over a recording, counted from its current."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.cell import CellParameters


def counted_soc(cell: CellParameters, start_soc: float, time_s: Array, current_A: Array) -> Array:
    """State of charge (N,) at each row, with the current of a row held until the next."""
    drawn_As = np.cumsum(current_A[:-1] * np.diff(time_s))
    return start_soc - np.concatenate([[0.0], drawn_As]) / cell.capacity_As
