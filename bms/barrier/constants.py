"""Constants of the four barrier constraints, in the form that the firmware evaluates.

With s the state of charge, Tc, Ts, Tinf the temperatures, u the current (negative while charging)
and e the estimation error bound, the left-hand sides that must not be negative are

  voltage  V_max - Vo(s) + R0 u
  soc      u/C_bat + alpha1 (s_max - s) - soc disturbance
  core     A1 (Tc - Ts) + alpha2 (Tc_max - Tc) + A2 Tc u - A3 u^2 - core disturbance
           - |A1 - alpha2 + A2 u| e
  surface  A4 (Tc - Ts) + A6 (Tinf - Ts) + alpha3 (Ts_max - Ts) + A8 Tc u + A9 u^2 + A10 Qc
           - Delta4 - |A4 + A8 u| e

each less its margin for sampling. The surface line equals A4 Tc + A5 Ts + A6 Tinf + A7 + ... of
the paper because A4 + A5 + A6 = -alpha3; in temperature differences nothing cancels in float32.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bms.cell import CellParameters
from bms.presets.schema import Preset


@dataclass(frozen=True)
class BarrierConstants:
    """Coefficients A1..A10 and Delta4 (paper, table of constants, corrected: docs/theory.md)."""

    a1_per_s: Any
    a2_per_As: Any
    a3_K_per_A2s: Any
    a4_per_s2: Any
    a5_per_s2: Any
    a6_per_s2: Any
    a7_K_per_s2: Any
    a8_per_As2: Any
    a9_K_per_A2s2: Any
    a10_K_per_Ws2: Any
    delta4_K_per_s2: Any


def barrier_constants(cell: CellParameters, preset: Preset) -> BarrierConstants:
    """Constants for a cell with the gains, limits and uncertainty bounds of a preset.

    The cell is separate so that arrays of candidate parameters pass through as well.
    """
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    cinf = cell.coolant_heat_capacity_J_per_K
    alpha3, alpha4 = preset.gains.alpha3_per_s2, preset.gains.alpha4_per_s
    a4 = 1 / (rc**2 * cc * cs) + 1 / (rc**2 * cs**2) + 1 / (rc * rs * cs**2) - alpha4 / (rc * cs)
    a6 = 1 / (rc * rs * cs**2) + 1 / (rs**2 * cs**2) + 1 / (rs**2 * cs * cinf) - alpha4 / (rs * cs)
    return BarrierConstants(
        a1_per_s=1 / (rc * cc),
        a2_per_As=cell.entropic_coefficient_V_per_K / cc,
        a3_K_per_A2s=cell.ohmic_resistance_ohm / cc,
        a4_per_s2=a4,
        a5_per_s2=-a4 - a6 - alpha3,
        a6_per_s2=a6,
        a7_K_per_s2=alpha3 * preset.limits.max_surface_temperature_K,
        a8_per_As2=cell.entropic_coefficient_V_per_K / (rc * cc * cs),
        a9_K_per_A2s2=-cell.ohmic_resistance_ohm / (rc * cc * cs),
        a10_K_per_Ws2=1 / (rs * cs * cinf),
        delta4_K_per_s2=_surface_reserve_K_per_s2(cell, preset),
    )


def surface_rate_in_force_K_per_s2(cell: CellParameters, preset: Preset) -> Any:
    """Bound on the surface disturbance's slope with which the paper's Delta4 is the one in force.

    The preset's own in the paper's form; otherwise, where no slope is assumed, what the worst case
    in the chain counts for.
    """
    gains, bounds = preset.gains, preset.uncertainty
    if gains.surface_condition == "paper":
        return bounds.surface_rate_K_per_s2
    own_per_s = 1 / (cell.core_resistance_K_per_W * cell.surface_heat_capacity_J_per_K) + 1 / (
        cell.surface_resistance_K_per_W * cell.surface_heat_capacity_J_per_K
    )
    first_per_s, second_per_s = gains.surface_roots_per_s
    in_chain_per_s = abs(own_per_s - first_per_s) + second_per_s
    return (in_chain_per_s - abs(own_per_s - gains.alpha4_per_s)) * bounds.surface_K_per_s


def _surface_reserve_K_per_s2(cell: CellParameters, preset: Preset) -> Any:
    """Delta4: what disturbances can take from the surface condition.

    In the paper's form the chain contains the surface disturbance itself, so that its slope counts;
    in the other form the chain has the disturbance's worst case in it (docs/theory.md).
    """
    gains, bounds = preset.gains, preset.uncertainty
    from_core = 1 / (cell.core_resistance_K_per_W * cell.surface_heat_capacity_J_per_K)
    from_coolant = 1 / (cell.surface_resistance_K_per_W * cell.surface_heat_capacity_J_per_K)
    others = bounds.core_K_per_s * from_core + bounds.coolant_K_per_s * from_coolant
    own_per_s = from_core + from_coolant
    if gains.surface_condition == "paper":
        return (
            others
            + abs(own_per_s - gains.alpha4_per_s) * bounds.surface_K_per_s
            + bounds.surface_rate_K_per_s2
        )
    first_per_s, second_per_s = gains.surface_roots_per_s
    return others + (abs(own_per_s - first_per_s) + second_per_s) * bounds.surface_K_per_s
