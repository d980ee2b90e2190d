"""The four constraints as design page 1 prints them, in float64 and from named parameters only.

Independent of bms.barrier: sums of absolute temperatures, every coefficient written out here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

Quadratic = tuple[float, float, float]
"""constant, linear and quadratic coefficient in u"""

NAMES = ("voltage", "soc", "core", "surface")


def quadratics(p: Mapping[str, Any], state: Mapping[str, float]) -> list[list[Quadratic]]:
    """For each constraint the concave quadratics that all must be >= 0 (two with an error term)."""
    rc, cc = p["core_resistance_K_per_W"], p["core_heat_capacity_J_per_K"]
    rs, cs = p["surface_resistance_K_per_W"], p["surface_heat_capacity_J_per_K"]
    cinf, r0 = p["coolant_heat_capacity_J_per_K"], p["ohmic_resistance_ohm"]
    entropy, e_max = p["entropic_coefficient_V_per_K"], p["estimation_error_bound_K"]
    soc, that = state["soc"], state["core_temperature_K"]
    ts, tinf = state["surface_temperature_K"], state["coolant_temperature_K"]
    a1, a2, a3 = 1 / (rc * cc), entropy / cc, r0 / cc
    a4 = 1 / (rc**2 * cc * cs) + 1 / (rc * cs) ** 2 + 1 / (rc * rs * cs**2)
    a4 -= p["alpha4"] / (rc * cs)
    a6 = 1 / (rc * rs * cs**2) + 1 / (rs * cs) ** 2 + 1 / (rs**2 * cs * cinf)
    a6 -= p["alpha4"] / (rs * cs)
    a5 = -a4 - 1 / (rc * rs * cs**2) - 1 / (rs**2 * cs**2) - 1 / (rs**2 * cs * cinf)
    a5 += p["alpha4"] / (rs * cs) - p["alpha3"]
    a7 = p["alpha3"] * p["max_surface_temperature_K"]
    a8, a9, a10 = entropy / (rc * cc * cs), -r0 / (rc * cc * cs), 1 / (rs * cs * cinf)
    delta4 = (
        p["core_uncertainty_K_per_s"] / (rc * cs)
        + abs(1 / (rc * cs) + 1 / (rs * cs) - p["alpha4"]) * p["surface_uncertainty_K_per_s"]
        + p["coolant_uncertainty_K_per_s"] / (rs * cs)
        + p["surface_uncertainty_rate_K_per_s2"]
    )
    voltage = (
        p["max_voltage_V"] - np.interp(soc, p["ocv_soc"], p["ocv_V"]) - p["voltage_margin_V"],
        r0,
        0.0,
    )
    charge = (
        p["alpha1"] * (p["max_soc"] - soc) - p["soc_uncertainty_per_s"] - p["soc_margin_per_s"],
        1 / (p["capacity_Ah"] * 3600),
        0.0,
    )
    core = [
        (
            a1 * (that - ts)
            + p["alpha2"] * (p["max_core_temperature_K"] - that)
            - p["core_uncertainty_K_per_s"]
            - p["core_margin_K_per_s"]
            - sign * (a1 - p["alpha2"]) * e_max,
            a2 * that - sign * a2 * e_max,
            -a3,
        )
        for sign in (1, -1)
    ]
    surface = [
        (
            a4 * that
            + a5 * ts
            + a6 * tinf
            + a7
            + a10 * state["cooling_power_W"]
            - delta4
            - p["surface_margin_K_per_s2"]
            - sign * a4 * e_max,
            a8 * that - sign * a8 * e_max,
            a9,
        )
        for sign in (1, -1)
    ]
    return [[voltage], [charge], core, surface]


def value(quadratic: Quadratic, u: float) -> float:
    """Left-hand side at a current."""
    return quadratic[0] + quadratic[1] * u + quadratic[2] * u * u


def interval(groups: list[list[Quadratic]], reference_current_A: float) -> tuple[float, float]:
    """Currents that all quadratics and reference <= u <= 0 admit; lower > upper for none."""
    lower, upper = reference_current_A, 0.0
    for constant, linear, quadratic in (q for group in groups for q in group):
        roots = np.roots([quadratic, linear, constant] if quadratic else [linear, constant])
        if np.any(np.iscomplex(roots)):
            return 1.0, -1.0
        if quadratic:
            lower, upper = max(lower, roots.real.min()), min(upper, roots.real.max())
        elif linear > 0:
            lower = max(lower, roots.real[0])
    return lower, upper
