"""The two thermal states of the cell over a recording, from its current and coolant."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.cell import CellParameters
from bms.data.measurements import Measurements


def thermal_trajectory(
    cell: CellParameters, recording: Measurements, heat_W: Array | None = None
) -> tuple[Array, Array]:
    """Core and surface temperature in K, both (N,), from the first measured ones on.

    Exact solution of the cell model between the recording's own times, with the current of a row
    held until the next row and the coolant at the mean of both. A heat (N - 1,) that is given takes
    the place of the cell's own. Source: design, cell model.
    """
    step_s = np.diff(recording.time_s)
    current_A = recording.current_A[:-1]
    coolant_K = 0.5 * (recording.coolant_temperature_K[1:] + recording.coolant_temperature_K[:-1])
    core_J_per_K, surface_J_per_K = (
        cell.core_heat_capacity_J_per_K,
        cell.surface_heat_capacity_J_per_K,
    )
    inner_W_per_K = 1.0 / cell.core_resistance_K_per_W
    outer_W_per_K = 1.0 / cell.surface_resistance_K_per_W
    # d/dt [core, surface] = [[a, b], [c, d]] [core, surface] + [f, g]
    if heat_W is None:
        reversible_W_per_K = cell.entropic_coefficient_V_per_K * current_A
        heat_W = cell.ohmic_resistance_ohm * current_A**2
    else:
        reversible_W_per_K = np.zeros_like(current_A)
    a = -(inner_W_per_K + reversible_W_per_K) / core_J_per_K
    b = inner_W_per_K / core_J_per_K
    c = inner_W_per_K / surface_J_per_K
    d = -(inner_W_per_K + outer_W_per_K) / surface_J_per_K
    f = heat_W / core_J_per_K
    g = outer_W_per_K * coolant_K / surface_J_per_K

    middle, half_gap = 0.5 * (a + d), np.sqrt((0.5 * (a - d)) ** 2 + b * c)
    slow, fast = np.exp((middle + half_gap) * step_s), np.exp((middle - half_gap) * step_s)
    mean, slope = 0.5 * (slow + fast), 0.5 * (slow - fast) / half_gap
    determinant = a * d - b * c
    rows = zip(
        *(
            column.tolist()
            for column in (
                mean + slope * (a - middle),
                slope * b,
                slope * c,
                mean + slope * (d - middle),
                (b * g - d * f) / determinant,
                (c * f - a * g) / determinant,
            )
        )
    )
    core_K = float(recording.core_temperature_K[0])
    surface_K = float(recording.surface_temperature_K[0])
    states = [(core_K, surface_K)]
    for core_core, core_surface, surface_core, surface_surface, core_rest_K, surface_rest_K in rows:
        core_K, surface_K = core_K - core_rest_K, surface_K - surface_rest_K
        core_K, surface_K = (
            core_rest_K + core_core * core_K + core_surface * surface_K,
            surface_rest_K + surface_core * core_K + surface_surface * surface_K,
        )
        states.append((core_K, surface_K))
    trajectory = np.array(states)
    return trajectory[:, 0], trajectory[:, 1]
