"""One step of the classical Runge-Kutta method for the cell model.

The fastest thermal mode of a 26650 cell is about 5 s, so a step of 10 ms leaves an error far below
1e-6 K over a charge (tests/bms/test_cell.py measures it).
"""

from __future__ import annotations

from typing import Any

from bms.cell.model import NO_DISTURBANCE, CellState, Disturbance, rates
from bms.cell.parameters import CellParameters
from bms.cell.polarisation import Polarisation, polarisation_after_V, polarisation_heat_W


def _advance(state: CellState, rate: CellState, step_s: float) -> CellState:
    return CellState(
        state[0] + step_s * rate[0],
        state[1] + step_s * rate[1],
        state[2] + step_s * rate[2],
        state[3] + step_s * rate[3],
    )


def integrate_step(
    cell: CellParameters,
    state: CellState,
    current_A: Any,
    cooling_power_W: Any,
    step_s: float,
    disturbance_before: Disturbance = NO_DISTURBANCE,
    disturbance_after: Disturbance | None = None,
    polarisation_V: Polarisation = (),
) -> CellState:
    """State after step_s seconds of constant current and cooling power.

    The disturbance runs linearly from its value before to its value after the step (constant when
    only one is given). The voltages of the branches are those before the step; their heat is exact
    at its beginning, middle and end, and without them there is none of it. Floats or arrays of one
    shape.
    """
    before = disturbance_before
    if disturbance_after is None or disturbance_after is before:
        middle = after = before
    else:
        after = disturbance_after
        middle = Disturbance(*(0.5 * (a + b) for a, b in zip(before, after)))
    heat_W = _branch_heat_W(cell, polarisation_V, current_A, step_s)
    drive = current_A, cooling_power_W
    k1 = rates(cell, state, *drive, before, heat_W[0])
    k2 = rates(cell, _advance(state, k1, 0.5 * step_s), *drive, middle, heat_W[1])
    k3 = rates(cell, _advance(state, k2, 0.5 * step_s), *drive, middle, heat_W[1])
    k4 = rates(cell, _advance(state, k3, step_s), *drive, after, heat_W[2])
    mean = CellState(
        (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]) / 6.0,
        (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]) / 6.0,
        (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2]) / 6.0,
        (k1[3] + 2.0 * (k2[3] + k3[3]) + k4[3]) / 6.0,
    )
    return _advance(state, mean, step_s)


def _branch_heat_W(
    cell: CellParameters, polarisation_V: Polarisation, current_A: Any, step_s: float
) -> tuple[Any, Any, Any]:
    """Heat of the branches at the beginning, in the middle and at the end of a step."""
    if not polarisation_V:
        return 0, 0, 0
    middle_V = polarisation_after_V(cell, polarisation_V, current_A, 0.5 * step_s)
    after_V = polarisation_after_V(cell, polarisation_V, current_A, step_s)
    return (
        polarisation_heat_W(cell, polarisation_V),
        polarisation_heat_W(cell, middle_V),
        polarisation_heat_W(cell, after_V),
    )
