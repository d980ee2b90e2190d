"""How cold the surface of no cell of a family can be.

The prediction of bms/barrier/surface_prediction.py for the cell of the family whose surface stays
coldest for the same heat, driven by the least heat that a current can make. What the dynamics of
other cells can be behind it is the positive part of the difference of their responses, integrated.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from bms.arrays import Array
from bms.barrier.family import corner_cells, family_of, ohmic_ohm, temperatures_K
from bms.barrier.readings import reading_errors
from bms.cell import CellParameters
from bms.presets.schema import Preset

_STEP_S, _LONGEST_S = 1.0, 1500.0


def coldest_cell(preset: Preset) -> CellParameters:
    """Constant cell whose surface is the reference: least resistances and least dU/dT."""
    cell, interval = preset.cell, family_of(preset)
    box, limits = preset.operating_box, preset.limits
    temperature_K = temperatures_K(
        cell, box.surface_temperature_K[0], limits.max_core_temperature_K
    )
    entropic = (
        cell.entropic_coefficient_V_per_K if cell.entropy is None else min(cell.entropy.V_per_K)
    )
    return replace(
        cell,
        surface_resistance_K_per_W=cell.surface_resistance_K_per_W * interval.surface_resistance[0],
        ohmic_resistance_ohm=float(ohmic_ohm(cell, temperature_K)[0].min())
        * interval.resistance[0],
        entropic_coefficient_V_per_K=entropic - interval.entropic_error_V_per_K,
    )


def family_error_bound_K(preset: Preset) -> float:
    """By how much the surface of a cell of the family can be below that of `coldest_cell`."""
    reference, limits = coldest_cell(preset), preset.limits
    strongest_A = -limits.reference_current_A * (1.0 + preset.supply.tolerance)
    heat_W = strongest_A * (
        reference.ohmic_resistance_ohm * strongest_A
        + max(0.0, reference.entropic_coefficient_V_per_K) * limits.max_core_temperature_K
    )
    # The coolant may differ at plug-in, and then follows the heat that it takes up.
    swing_K = preset.plug_in.coolant_offset_K + heat_W * reference.surface_resistance_K_per_W
    by_heat, by_coolant = _responses(reference)
    behind_K = 0.0
    for corner in corner_cells(preset.cell, family_of(preset)):
        heat, coolant = _responses(corner)
        behind_K = max(
            behind_K,
            heat_W * float(np.sum(np.maximum(by_heat - heat, 0.0)))
            + swing_K * float(np.sum(np.abs(by_coolant - coolant))),
        )
    errors, noise = reading_errors(preset), preset.uncertainty
    disturbed_K = reference.surface_resistance_K_per_W * (
        reference.core_heat_capacity_J_per_K * float(noise.core_at_K_per_s(strongest_A))
        + reference.surface_heat_capacity_J_per_K * noise.surface_K_per_s
    )
    return behind_K + disturbed_K + 2.0 * errors.surface_K + errors.coolant_K


def _responses(cell: CellParameters) -> tuple[Array, Array]:
    """Rise of the surface in each step after an impulse of heat (K/J) and of the coolant (1/s)."""
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    matrix = np.array(
        [[-1.0 / (rc * cc), 1.0 / (rc * cc)], [1.0 / (rc * cs), -1.0 / (rc * cs) - 1.0 / (rs * cs)]]
    )
    sources = np.array([[1.0 / cc, 0.0], [0.0, 1.0 / (rs * cs)]])
    transition = expm(matrix * _STEP_S)
    state = np.linalg.solve(matrix, (transition - np.eye(2)) @ sources)
    rises = []
    for _ in range(int(_LONGEST_S / _STEP_S)):
        rises.append(state[1])
        state = transition @ state
    by_heat, by_coolant = np.array(rises).T
    return by_heat, by_coolant
