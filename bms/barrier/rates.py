"""How fast a weighted sum of the three temperatures can change while charging.

The heat flows F1 (core to surface) and F2 (surface to coolant) obey a stable linear system that
the heat in the core, in the surface and the cooling drive. So the rate of any weighted sum of
temperatures is an output of that system, and its largest value over every history of inputs
within their ranges is the integral of the impulse response's positive part times the upper end of
the range, plus that of its negative part times the lower end. Both follow in closed form, because
the response is a sum of two real exponentials and changes sign at most once. The bound is attained.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from bms.cell import CellParameters
from bms.presets.schema import Preset


class Interval(NamedTuple):
    """Lower and upper end; floats or arrays."""

    low: Any
    high: Any


class Weights(NamedTuple):
    """Weights of core, surface and coolant temperature in the sum."""

    core: Any
    surface: Any
    coolant: Any


def heat_range_W(cell: CellParameters, preset: Preset) -> Interval:
    """Range of the heat generated in the core at currents from the reference to 0 A, in W."""
    current_A = -preset.limits.reference_current_A
    resistance_ohm = cell.ohmic_resistance_ohm
    slope_V = np.asarray(cell.entropic_coefficient_V_per_K * preset.limits.max_core_temperature_K)
    coolest_A = np.clip(-slope_V / (2.0 * resistance_ohm), 0.0, current_A)
    return Interval(
        low=coolest_A * (resistance_ohm * coolest_A + slope_V),
        high=current_A * (resistance_ohm * current_A + np.maximum(slope_V, 0.0)),
    )


def largest_rate(
    cell: CellParameters, preset: Preset, weights: Weights, heat_W: Interval | None = None
) -> Any:
    """Largest d/dt of the weighted sum of temperatures, in K/s times the weights' unit.

    Holds from a start at rest (all temperatures equal) for every current from the reference to
    0 A, or every heat of a range that is given instead, every cooling power of the operating box
    and every disturbance within its bounds.
    """
    rc, cc = cell.core_resistance_K_per_W, cell.core_heat_capacity_J_per_K
    rs, cs = cell.surface_resistance_K_per_W, cell.surface_heat_capacity_J_per_K
    cinf = cell.coolant_heat_capacity_J_per_K
    bounds = preset.uncertainty
    heat = heat_range_W(cell, preset) if heat_W is None else heat_W
    cooling_high_W = preset.operating_box.cooling_power_W[1]

    # A disturbance of a rate acts like heat in that node; 0 W, the state at rest, is in each range.
    core_W = Interval(heat.low - cc * bounds.core_K_per_s, heat.high + cc * bounds.core_K_per_s)
    surface_W = Interval(-cs * bounds.surface_K_per_s, cs * bounds.surface_K_per_s)
    cooling_W = Interval(
        -cinf * bounds.coolant_K_per_s, cooling_high_W + cinf * bounds.coolant_K_per_s
    )
    system = (
        -1 / (rc * cc) - 1 / (rc * cs),
        1 / (rc * cs),
        1 / (rs * cs),
        -1 / (rs * cs) - 1 / (rs * cinf),
    )
    output = (
        weights.surface / cs - weights.core / cc,
        weights.coolant / cinf - weights.surface / cs,
    )
    return (
        _largest_output(system, (1 / (rc * cc), 0.0), output, weights.core / cc, core_W)
        + _largest_output(
            system, (-1 / (rc * cs), 1 / (rs * cs)), output, weights.surface / cs, surface_W
        )
        + _largest_output(
            system, (0.0, 1 / (rs * cinf)), output, -weights.coolant / cinf, cooling_W
        )
    )


def _largest_output(
    system: tuple[Any, Any, Any, Any],
    source: tuple[Any, Any],
    output: tuple[Any, Any],
    direct: Any,
    span: Interval,
) -> Any:
    """Largest output of x' = M x + source w, y = output x + direct w, over w(t) in a range."""
    m11, m12, m21, m22 = system
    root = np.sqrt((m11 - m22) ** 2 + 4.0 * m12 * m21)
    slow, fast = 0.5 * (m11 + m22 + root), 0.5 * (m11 + m22 - root)
    gain = output[0] * source[0] + output[1] * source[1]
    drift = output[0] * (m11 * source[0] + m12 * source[1]) + output[1] * (
        m21 * source[0] + m22 * source[1]
    )
    # Impulse response: slow_part exp(slow t) + fast_part exp(fast t).
    slow_part, fast_part = (drift - fast * gain) / root, (slow * gain - drift) / root
    with np.errstate(divide="ignore", invalid="ignore"):
        change_s = np.log(-fast_part / slow_part) / root
    change_s = np.where(np.isfinite(change_s) & (change_s > 0.0), change_s, 0.0)
    late = -(slow_part / slow) * np.exp(slow * change_s) - (fast_part / fast) * np.exp(
        fast * change_s
    )
    early = -(slow_part / slow) - (fast_part / fast) - late
    return sum(np.maximum(part * span.low, part * span.high) for part in (direct, early, late))
