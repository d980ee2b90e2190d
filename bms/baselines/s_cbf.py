"""S-CBF: barriers on voltage, state of charge and surface temperature only, in a cascade.

Method of Feng et al. 2024 as the paper describes it (section "Simulation results"): true states,
no margins for uncertainty, no reversible heat in the design. The thermal stage chooses the heat
q = R0 u^2 nearest to the wanted one subject to the surface barrier, which is linear in q; the
electrical stage chooses the current nearest to the reference subject to |u| <= sqrt(q / R0),
voltage and state of charge. Both are quadratic programs in one variable over an interval, so the
optimum is the projection onto the interval and no solver is needed.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from bms.barrier import BarrierConstants, barrier_constants
from bms.cell import CellParameters, CellState
from bms.decision import ConstraintMargins, Decision, Observation
from bms.presets import Preset


class SurfaceBarrier(NamedTuple):
    """The surface barrier as limit_K_per_s2 - slope_K_per_Ws2 * heat_W >= 0."""

    limit_K_per_s2: Any
    slope_K_per_Ws2: Any


def surface_barrier(
    cell: CellParameters,
    preset: Preset,
    constants: BarrierConstants,
    state: CellState,
    cooling_power_W: Any,
) -> SurfaceBarrier:
    """Second-order surface barrier, linear in the Joule heat; floats or arrays of one shape."""
    _, core_K, surface_K, coolant_K = state
    limit = (
        constants.a4_per_s2 * (core_K - surface_K)
        + constants.a6_per_s2 * (coolant_K - surface_K)
        + preset.gains.alpha3_per_s2 * (preset.limits.max_surface_temperature_K - surface_K)
        + constants.a10_K_per_Ws2 * cooling_power_W
    )
    return SurfaceBarrier(limit, -constants.a9_K_per_A2s2 / cell.ohmic_resistance_ohm)


def allowed_heat_W(barrier: SurfaceBarrier, wanted_W: Any) -> Any:
    """Thermal stage: heat in [0, wanted] nearest to the wanted one under the barrier, in W.

    Negative where even no heat violates the barrier.
    """
    return np.minimum(barrier.limit_K_per_s2 / barrier.slope_K_per_Ws2, wanted_W)


def current_bounds_A(
    cell: CellParameters, preset: Preset, soc: Any, heat_W: Any
) -> tuple[Any, Any, Any]:
    """Electrical stage: lowest current that heat, voltage and state of charge allow, in A."""
    limits = preset.limits
    return (
        -np.sqrt(np.maximum(heat_W, 0.0) / cell.ohmic_resistance_ohm),
        -(limits.max_voltage_V - cell.ocv(soc)) / cell.ohmic_resistance_ohm,
        -cell.capacity_As * preset.gains.alpha1_per_s * (limits.max_soc - soc),
    )


def charging_current_A(
    cell: CellParameters,
    preset: Preset,
    constants: BarrierConstants,
    state: CellState,
    cooling_power_W: Any,
) -> Any:
    """Current of the cascade in A for many cells or states at once; 0 A where nothing is allowed."""
    reference_A = preset.limits.reference_current_A
    heat_W = allowed_heat_W(
        surface_barrier(cell, preset, constants, state, cooling_power_W),
        cell.ohmic_resistance_ohm * reference_A**2,
    )
    thermal_A, voltage_A, soc_A = current_bounds_A(cell, preset, state.soc, heat_W)
    lower_A = np.maximum(np.maximum(thermal_A, voltage_A), np.maximum(soc_A, reference_A))
    return np.where((heat_W >= 0.0) & (lower_A <= 0.0), lower_A, 0.0)
