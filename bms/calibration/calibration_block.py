"""The firmware's calibration block: every number that depends on a preset or a model.

The fields carry the names of bms_calibration_t, so that one mapping fills the structure at run
time and is printed as a C initialiser by codegen.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from bms.barrier import barrier_constants, sampling_margins
from bms.barrier.readings import soc_reserve
from bms.barrier.surface_prediction import surface_prediction
from bms.calibration.family_block import family_fields
from bms.calibration.planner_block import planner_fields
from bms.calibration.plausibility import plausibility_fields
from bms.errors import InputError
from bms.model.model_file import KanModel
from bms.model.pair import check_pair
from bms.presets import Preset
from bms.tables.network_tables import network_tables

LAYOUT = 5
"""Layout number of bms_calibration_t that this module fills (BMS_CALIBRATION_LAYOUT)."""
MAX_OCV_POINTS = 64

_LIMITS = ("max_core_temperature_K", "max_surface_temperature_K")

NO_CHANGES: Mapping[str, float] = MappingProxyType({})


def calibration_fields(
    preset: Preset, model: KanModel, changes: Mapping[str, float] = NO_CHANGES
) -> dict[str, Any]:
    """Content of bms_calibration_t as nested mapping, lists and numbers.

    `changes` are constants of the controller, by field name, that a study sets to other values.
    Raises ModelMismatchError for a stale pair and InputError for what does not fit the maxima or
    for a change of a constant that does not exist.
    """
    check_pair(preset, model)
    if len(preset.cell.ocv.soc) > MAX_OCV_POINTS:
        raise InputError(f"preset '{preset.name}': cell.ocv: at most {MAX_OCV_POINTS} points")
    fields: dict[str, Any] = {
        "layout": LAYOUT,
        "model_hash": int(model.hash[:8], 16),
        "preset_hash": int(preset.hash[:8], 16),
        "sampling_period_s": preset.timing.sampling_period_s,
        "reference_current_A": preset.limits.reference_current_A,
        "current_growth_A": preset.limits.current_growth_A_per_s * preset.timing.sampling_period_s,
        "completion_soc": preset.limits.completion_soc,
        "soc_error": soc_reserve(preset.cell, preset),
        "rcbf": _barrier_fields(preset, model.error_bound_K),
        "plausibility": plausibility_fields(preset),
        "thermal": _thermal_fields(preset),
        "family": family_fields(preset),
        "planner": planner_fields(preset),
        "kan": network_tables(model.network).fields(model.network, preset.timing.sampling_period_s),
    }
    for name, value in changes.items():
        section = fields["rcbf"] if name in fields["rcbf"] else fields
        if name in _LIMITS:
            section[name] = _temperature_fields(value)
        elif isinstance(section.get(name), float):
            section[name] = float(value)
        else:
            raise InputError(f"calibration: no constant '{name}' to change; see bms_calibration_t")
    return fields


def _barrier_fields(preset: Preset, error_bound_K: float) -> dict[str, Any]:
    cell, limits, gains = preset.cell, preset.limits, preset.gains
    constants = barrier_constants(cell, preset)
    margins = sampling_margins(cell, preset)
    return {
        "capacity_As": cell.capacity_As,
        "ohmic_resistance_ohm": cell.ohmic_resistance_ohm,
        "max_voltage_V": limits.max_voltage_V,
        "max_soc": limits.max_soc,
        "max_core_temperature_K": _temperature_fields(limits.max_core_temperature_K),
        "max_surface_temperature_K": _temperature_fields(limits.max_surface_temperature_K),
        "alpha1_per_s": gains.alpha1_per_s,
        "alpha2_per_s": gains.core_gain_per_s(cell),
        "alpha3_per_s2": gains.alpha3_per_s2,
        "a1_per_s": constants.a1_per_s,
        "a2_per_As": constants.a2_per_As,
        "a3_K_per_A2s": constants.a3_K_per_A2s,
        "a4_per_s2": constants.a4_per_s2,
        "a6_per_s2": constants.a6_per_s2,
        "a8_per_As2": constants.a8_per_As2,
        "a9_K_per_A2s2": constants.a9_K_per_A2s2,
        "a10_K_per_Ws2": constants.a10_K_per_Ws2,
        "delta4_K_per_s2": constants.delta4_K_per_s2,
        "soc_uncertainty_per_s": preset.uncertainty.soc_per_s,
        "core_uncertainty_K_per_s": preset.uncertainty.core_K_per_s,
        "estimation_error_bound_K": error_bound_K,
        "voltage_margin_V": margins.voltage_V,
        "soc_margin_per_s": margins.soc_per_s,
        "core_margin_K_per_s": margins.core_K_per_s,
        "surface_margin_K_per_s2": margins.surface_K_per_s2,
        "ocv_points": len(cell.ocv.soc),
        "ocv_soc": list(cell.ocv.soc),
        "ocv_V": list(cell.ocv.voltage_V),
    }


def _temperature_fields(temperature_K: float) -> dict[str, float]:
    """rcbf_temperature_t: what float32 cannot hold of a temperature is in a second number."""
    high_K = float(np.float32(temperature_K))
    return {"high_K": high_K, "low_K": temperature_K - high_K}


def _thermal_fields(preset: Preset) -> dict[str, Any]:
    prediction = surface_prediction(preset.cell, preset)
    return {
        "transition": prediction.transition.ravel().tolist(),
        "gain_K_per_W": prediction.gain_K_per_W.tolist(),
        "gain_coolant": prediction.gain_coolant.tolist(),
        "ohmic_resistance_ohm": prediction.ohmic_resistance_ohm,
        "entropic_coefficient_V_per_K": prediction.entropic_coefficient_V_per_K,
        "error_bound_K": prediction.error_bound_K,
    }
