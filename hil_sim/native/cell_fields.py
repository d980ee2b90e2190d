"""A cell as the C plant has it, with the exact step of its linear, thermal part."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.linalg import expm

from bms.arrays import Array
from bms.cell import CellParameters

_LINEAR = (
    "capacity_As",
    "core_resistance_K_per_W",
    "core_heat_capacity_J_per_K",
    "surface_resistance_K_per_W",
    "surface_heat_capacity_J_per_K",
    "coolant_heat_capacity_J_per_K",
    "ohmic_resistance_ohm",
    "entropic_coefficient_V_per_K",
)


def cell_fields(cell: CellParameters, step_s: float) -> dict[str, Any]:
    """Initialiser of a `cell_t` that is advanced in sub-steps of step_s."""
    fields: dict[str, Any] = {name: getattr(cell, name) for name in _LINEAR}
    fields |= {
        "step_s": step_s,
        "overfill_slope_V": cell.ocv.overfill_slope_V,
        "ocv_V": _curve(cell.ocv.soc, cell.ocv.voltage_V),
        "branches": len(cell.branches),
        "branch": [
            {
                "resistance_ohm": branch.resistance_ohm,
                "left_at_middle": math.exp(-0.5 * step_s / branch.time_constant_s),
                "left_at_end": math.exp(-step_s / branch.time_constant_s),
            }
            for branch in cell.branches
        ],
        "thermal": _thermal_step(cell, step_s),
    }
    if cell.entropy is not None:
        fields["entropy_V_per_K"] = _curve(cell.entropy.soc, cell.entropy.V_per_K)
    if cell.resistance is not None:
        table = cell.resistance
        fields["resistance"] = {
            "rows": len(table.temperature_K),
            "columns": len(table.soc),
            "temperature_K": table.temperature_K,
            "soc": table.soc,
            "ohm": [ohm for row in table.ohm for ohm in row],
        }
    return fields


def _curve(axis: tuple[float, ...], values: tuple[float, ...]) -> dict[str, Any]:
    return {"points": len(axis), "axis": axis, "value": values}


def _thermal_step(cell: CellParameters, step_s: float) -> dict[str, Any]:
    """Exact changes of core, surface and coolant temperature in a step, from a block exponential.

    With dx/dt = A x + w and w linear from w0 to w1: x1 - x0 = (e^(Ah) - 1) x0 + G0 w0 + G1 w1. The
    rows of A add up to 0, so that the first term takes differences of temperatures only.
    """
    rate_per_s = thermal_matrix_per_s(cell)
    one, zero = np.eye(3), np.zeros((3, 3))
    block = np.block(
        [
            [rate_per_s * step_s, one * step_s, zero],
            [zero, zero, one],
            [zero, zero, zero],
        ]
    )
    exponential = expm(block)
    change = exponential[:3, :3] - one
    held_s, rising_s = exponential[:3, 3:6], exponential[:3, 6:]
    return {
        "core_gap": change[:, 0].tolist(),
        "coolant_gap": change[:, 2].tolist(),
        "before_s": (held_s - rising_s).tolist(),
        "after_s": rising_s.tolist(),
        "heat_K_per_W": (held_s[:, 0] / cell.core_heat_capacity_J_per_K).tolist(),
        "cooling_K_per_W": (held_s[:, 2] / cell.coolant_heat_capacity_J_per_K).tolist(),
    }


def thermal_matrix_per_s(cell: CellParameters) -> Array:
    """Rates (1/s) of core, surface and coolant temperature by conduction alone, (3, 3)."""
    core_W_per_K = 1.0 / cell.core_resistance_K_per_W
    coolant_W_per_K = 1.0 / cell.surface_resistance_K_per_W
    flows_W_per_K = np.array(
        [
            [-core_W_per_K, core_W_per_K, 0.0],
            [core_W_per_K, -core_W_per_K - coolant_W_per_K, coolant_W_per_K],
            [0.0, coolant_W_per_K, -coolant_W_per_K],
        ]
    )
    capacities_J_per_K = np.array(
        [
            cell.core_heat_capacity_J_per_K,
            cell.surface_heat_capacity_J_per_K,
            cell.coolant_heat_capacity_J_per_K,
        ]
    )
    return np.asarray(flows_W_per_K / capacities_J_per_K[:, np.newaxis])
