"""Left-hand sides of the four constraints and the current that they allow; floats or arrays.

The firmware decides in C. This is the same arithmetic for design work on many cells or states at
once: calibration, proofs of the margins, oracles.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bms.barrier.constants import BarrierConstants
from bms.barrier.margins import Margins
from bms.cell import CellParameters, CellState
from bms.decision import ConstraintMargins
from bms.presets.schema import Preset


def left_hand_sides(
    cell: CellParameters,
    preset: Preset,
    constants: BarrierConstants,
    state: CellState,
    cooling_power_W: Any,
    current_A: Any,
    error_bound_K: Any = 0.0,
) -> ConstraintMargins:
    """What must not be negative, before the margins for sampling (V, 1/s, K/s, K/s^2).

    The state carries the estimated core temperature, within error_bound_K of the true one.
    Source: paper, proposition "KAN-rCBF charging optimization condition", corrected.
    """
    soc, core_K, surface_K, coolant_K = state
    a, limits, gains = constants, preset.limits, preset.gains
    core_gain = gains.core_gain_per_s(cell)
    squared = current_A * current_A
    return ConstraintMargins(
        voltage_V=limits.max_voltage_V - cell.ocv(soc) + cell.ohmic_resistance_ohm * current_A,
        soc_per_s=current_A / cell.capacity_As
        + gains.alpha1_per_s * (limits.max_soc - soc)
        - preset.uncertainty.soc_per_s,
        core_K_per_s=a.a1_per_s * (core_K - surface_K)
        + core_gain * (limits.max_core_temperature_K - core_K)
        + a.a2_per_As * core_K * current_A
        - a.a3_K_per_A2s * squared
        - preset.uncertainty.core_K_per_s
        - np.abs(a.a1_per_s - core_gain + a.a2_per_As * current_A) * error_bound_K,
        surface_K_per_s2=a.a4_per_s2 * (core_K - surface_K)
        + a.a6_per_s2 * (coolant_K - surface_K)
        + gains.alpha3_per_s2 * (limits.max_surface_temperature_K - surface_K)
        + a.a8_per_As2 * core_K * current_A
        + a.a9_K_per_A2s2 * squared
        + a.a10_K_per_Ws2 * cooling_power_W
        - a.delta4_K_per_s2
        - np.abs(a.a4_per_s2 + a.a8_per_As2 * current_A) * error_bound_K,
    )


def charging_current_A(
    cell: CellParameters,
    preset: Preset,
    constants: BarrierConstants,
    margins: Margins,
    state: CellState,
    cooling_power_W: Any,
    error_bound_K: Any = 0.0,
) -> Any:
    """Current nearest to the reference that keeps every left-hand side above its margin; else 0 A.

    The answer is the lower end of `current_interval_A`, and 0 A where that is empty.
    """
    lower_A, upper_A = current_interval_A(
        cell, preset, constants, margins, state, cooling_power_W, error_bound_K
    )
    return np.where(lower_A <= upper_A, lower_A, 0.0)


def current_interval_A(
    cell: CellParameters,
    preset: Preset,
    constants: BarrierConstants,
    margins: Margins,
    state: CellState,
    cooling_power_W: Any,
    error_bound_K: Any = 0.0,
) -> tuple[Any, Any]:
    """Charging currents that keep every left-hand side above its margin, from the reference to 0 A.

    Every side is concave in the current, an absolute value being the smaller of two quadratics, so
    each allows an interval. The lower end is above the upper one where there is none.
    """
    rest = left_hand_sides(cell, preset, constants, state, cooling_power_W, 0.0)
    lower_A: Any = preset.limits.reference_current_A
    upper_A: Any = 0.0
    for low_A in (
        -(rest.voltage_V - margins.voltage_V) / cell.ohmic_resistance_ohm,
        -(rest.soc_per_s - margins.soc_per_s) * cell.capacity_As,
    ):
        lower_A = np.maximum(lower_A, low_A)
    core_K = state.core_temperature_K
    for side in thermal_sides(cell, preset, constants, margins, rest, core_K, error_bound_K):
        low_A, high_A = quadratic_interval(*side)
        lower_A = np.maximum(lower_A, low_A)
        upper_A = np.minimum(upper_A, high_A)
    return lower_A, upper_A


def thermal_sides(
    cell: CellParameters,
    preset: Preset,
    constants: BarrierConstants,
    margins: Margins,
    rest: ConstraintMargins,
    core_K: Any,
    error_bound_K: Any = 0.0,
) -> list[tuple[Any, Any, Any]]:
    """(square, slope, constant) of each constant + slope u - square u^2 >= 0 on core and surface.

    One for either sign of the error of the core estimate; `rest` are the left-hand sides at 0 A.
    """
    a = constants
    core_error_per_s = a.a1_per_s - preset.gains.core_gain_per_s(cell)
    sides = []
    for sign in (-1.0, 1.0):
        error_K = sign * error_bound_K
        sides.append(
            (
                a.a3_K_per_A2s,
                a.a2_per_As * (core_K + error_K),
                rest.core_K_per_s - margins.core_K_per_s + core_error_per_s * error_K,
            )
        )
        sides.append(
            (
                -a.a9_K_per_A2s2,
                a.a8_per_As2 * (core_K + error_K),
                rest.surface_K_per_s2 - margins.surface_K_per_s2 + a.a4_per_s2 * error_K,
            )
        )
    return sides


def quadratic_interval(square: Any, slope: Any, rest: Any) -> tuple[Any, Any]:
    """Interval in which rest + slope u - square u^2 >= 0 (square > 0); (inf, -inf) where empty.

    Floats or arrays of one shape.
    """
    discriminant = slope * slope + 4.0 * square * rest
    # The larger sum first and the other root by Vieta, so that nothing cancels.
    with np.errstate(divide="ignore", invalid="ignore"):
        away = 0.5 * (slope + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), slope))
        first, second = away / square, -rest / away
    second = np.where(away == 0.0, 0.0, second)
    empty = discriminant < 0.0
    return (
        np.where(empty, np.inf, np.minimum(first, second)),
        np.where(empty, -np.inf, np.maximum(first, second)),
    )
