"""The part of the calibration block that states a family of cells (family_constants_t)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bms.barrier import family as bounds
from bms.barrier.readings import reading_errors
from bms.bus_signals import BUS
from bms.errors import InputError
from bms.presets import Preset

MAP_TEMPERATURES, MAP_CHARGES = 8, 8
LARGEST = float(np.finfo(np.float32).max)
_UP, _DOWN = 1.0 + 1e-5, 1.0 - 1e-5
"""Constants are moved to the safe side by more than float32 rounds them."""


def family_fields(preset: Preset) -> dict[str, Any]:
    """Content of family_constants_t; is_stated is 0 for a preset that describes one cell.

    Raises InputError for a map that is larger than the firmware's.
    """
    if preset.cell.interval is None:
        return {"is_stated": 0}
    cell, interval = preset.cell, preset.cell.interval
    timing, plug_in, supply, noise = (
        preset.timing, preset.plug_in, preset.supply, preset.uncertainty,
    )  # fmt: skip
    period_s, hold_s = timing.sampling_period_s, bounds.hold_s(preset)
    ends = bounds.extremes(cell, interval)
    errors = reading_errors(preset)
    grid_K = np.linspace(
        preset.operating_box.surface_temperature_K[0],
        preset.limits.max_core_temperature_K,
        bounds.TEMPERATURES,
    )
    fine_K = bounds.temperatures_K(cell, float(grid_K[0]), float(grid_K[-1]))
    least_ohm = float(bounds.ohmic_ohm(cell, fine_K)[0].min())
    outflow_W_per_K = 1.0 / ends.core_resistance[1]
    gain_W_per_K = (
        outflow_W_per_K
        if preset.gains.alpha2_per_s is None
        else max(outflow_W_per_K, preset.gains.alpha2_per_s * cell.core_heat_capacity_J_per_K)
    )
    fastest, slowest = ends.core_heat_capacity
    cooling = period_s / slowest / (1.0 + period_s / (ends.core_resistance[1] * slowest))
    return {
        "is_stated": 1,
        "plug_in_error": plug_in.soc_error + BUS.plug_in_soc,
        "least_soc_per_A": _DOWN * period_s / ends.capacity_As[1],
        "greatest_soc_per_A": _UP * period_s / ends.capacity_As[0],
        "hold_soc_per_A": _UP * hold_s / ends.capacity_As[0],
        "ocv_error_V": interval.ocv_error_V,
        "ocv_slope_V": (_UP * bounds.ocv_slopes_V(cell)).tolist(),
        "entropic_V_per_K": (bounds.entropic_V_per_K(cell, interval) + 1e-9).tolist(),
        "coldest_K": float(grid_K[0]),
        "per_step_K": 1.0 / float(grid_K[1] - grid_K[0]),
        "resistance_ohm": (_UP * bounds.warmest_resistance_ohm(preset, grid_K)).tolist(),
        "least_resistance_ohm": _DOWN * least_ohm * interval.resistance[0],
        "polarisation_ohm": _UP * bounds.polarisation_ohm(cell, interval),
        "relaxation": math.exp(-period_s / interval.longest_relaxation_s),
        "rest_polarisation_V": plug_in.polarisation_V,
        **_branches(preset),
        "inner_K": bounds.inner_K(preset),
        "outflow_W_per_K": _DOWN * outflow_W_per_K,
        "gain_W_per_K": gain_W_per_K,
        "core_K_per_J": 1.0 / slowest,
        "heating_K_per_W": _UP * period_s / fastest,
        "cooling_K_per_W": _DOWN * cooling,
        "coldest_core_K": min(
            preset.operating_box.surface_temperature_K[0],
            preset.operating_box.coolant_temperature_K[0],
        ),
        "disturbance_W": slowest * noise.core_K_per_s,
        "disturbance_W_per_A": slowest * noise.core_K_per_As,
        "disturbance_W_per_A2": slowest * noise.core_K_per_A2s,
        "hold_W": outflow_W_per_K * hold_s * bounds.surface_rise_K_per_s(preset),
        "estimate_error_K": preset.gains.estimate_error_K or LARGEST,
        **_rest(preset),
        "supply_tolerance": supply.tolerance,
        "supply_share": bounds.exponential_share(period_s, supply.lag_s),
        "current_error_A": bounds.current_error_A(preset),
        "voltage_error_V": bounds.voltage_error_V(preset),
        "surface_error_K": errors.surface_K,
        "coolant_error_K": errors.coolant_K,
        "hold_s": hold_s,
        "period_s": period_s,
        "full_ocv_V": float(cell.ocv(preset.limits.completion_soc)),
        "full_periods": bounds.FULL_PERIODS,
        "map": _map_fields(preset),
    }


def _branches(preset: Preset) -> dict[str, Any]:
    cell, interval = preset.cell, bounds.family_of(preset)
    factor = bounds.time_constant_factor(cell, interval)
    period_s = preset.timing.sampling_period_s
    shortest_s = min((b.time_constant_s for b in cell.branches), default=math.inf) / factor
    return {
        "rest_drift_per_s": 1.0 / shortest_s,
        "branches": len(cell.branches),
        "branch": [
            {
                "slow": _DOWN * bounds.exponential_share(period_s, branch.time_constant_s * factor),
                "fast": _UP * bounds.exponential_share(period_s, branch.time_constant_s / factor),
                "resistance_ohm": _UP * interval.polarisation[1] * branch.resistance_ohm,
                "drift_ohm_per_s": interval.polarisation[1]
                * branch.resistance_ohm
                * factor
                / branch.time_constant_s,
            }
            for branch in cell.branches
        ],
    }


def _rest(preset: Preset) -> dict[str, Any]:
    """How the surface at rest tells the core, and by how much that can be wrong."""
    ends = bounds.extremes(preset.cell, bounds.family_of(preset))
    errors, noise = reading_errors(preset), preset.uncertainty
    period_s = preset.timing.sampling_period_s
    periods = max(2, round(bounds.rest_s(preset) / period_s))
    window_s = (periods - 1) * period_s
    slowness_s = ends.core_resistance[1] * ends.surface_heat_capacity[1]
    per_gap = ends.core_resistance[1] / ends.surface_resistance[0]
    return {
        "rest_periods": periods,
        "per_surface_rise": slowness_s / window_s,
        "per_coolant_gap": per_gap,
        "rest_error_K": (1.0 + 2.0 * slowness_s / window_s + per_gap) * errors.surface_K
        + per_gap * errors.coolant_K
        + slowness_s * noise.surface_K_per_s
        + periods * period_s * noise.core_K_per_s,
        **_charge_window(preset),
    }


def _charge_window(preset: Preset) -> dict[str, Any]:
    """How hot the core is at least, by the surface in a charge."""
    ends = bounds.extremes(preset.cell, bounds.family_of(preset))
    errors, period_s = reading_errors(preset), preset.timing.sampling_period_s
    periods = max(2, round(bounds.CHARGE_WINDOW_S / period_s))
    window_s = (periods - 1) * period_s
    slowest_s = ends.core_resistance[1] * ends.surface_heat_capacity[1]
    fastest_s = ends.core_resistance[0] * ends.surface_heat_capacity[0]
    per_gap = ends.core_resistance[0] / ends.surface_resistance[1]
    return {
        "charge_periods": periods,
        "least_per_surface_rise": fastest_s / window_s,
        "most_per_surface_fall": slowest_s / window_s,
        "least_per_coolant_gap": per_gap,
        "charge_error_K": (1.0 + 2.0 * slowest_s / window_s + per_gap) * errors.surface_K
        + per_gap * errors.coolant_K
        + slowest_s * preset.uncertainty.surface_K_per_s,
    }


def _map_fields(preset: Preset) -> dict[str, Any]:
    table = preset.current_map
    strongest_A = -preset.limits.reference_current_A * (1.0 + preset.supply.tolerance)
    if table is None:
        return {
            "temperatures": 2,
            "charges": 2,
            "temperature_K": [200.0, 400.0],
            "soc": [0.0, 1.0],
            "strength_A": [strongest_A] * 4,
        }
    if len(table.temperature_K) > MAP_TEMPERATURES or len(table.soc) > MAP_CHARGES:
        raise InputError(
            f"preset '{preset.name}': current_map: at most {MAP_TEMPERATURES} temperatures and "
            f"{MAP_CHARGES} states of charge"
        )
    return {
        "temperatures": len(table.temperature_K),
        "charges": len(table.soc),
        "temperature_K": list(table.temperature_K),
        "soc": list(table.soc),
        "strength_A": [value for row in table.largest_A for value in row],
    }
