"""What keeps a preset from its certificate, or from a finished charge: reason, state, remedy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from bms.barrier import sampling_margins
from bms.cell import CellState
from bms.presets import Preset
from bms.verification.certificate import Certificate
from bms.verification.decision import decide
from bms.verification.fallback import Fallback
from bms.verification.search import CounterExample

SOC_STEP, VOLTAGE_STEP_V, TEMPERATURE_STEP_K = 1e-3, 1e-3, 0.1
"""To these a remedy is rounded, to the safe side."""
NOT_COVERED = (
    "shorten timing.delay_s or timing.sampling_period_s, and report the preset: its margins should "
    "have covered this"
)


@dataclass(frozen=True)
class Finding:
    """Why, in which state (names with units), and what to change."""

    reason: str
    state: Mapping[str, float]
    change: str


def refusal(
    certificate: Certificate,
    example: CounterExample | None,
    margin: tuple[str, float],
    slips: tuple[str, ...],
) -> Finding | None:
    """Why a barrier is not certified; None when it is. `margin` is its name and value in force."""
    shortfall = certificate.shortfall
    if example is not None:
        finding = Finding("a simulated decision crosses the limit", _state(example), NOT_COVERED)
    elif shortfall is None:
        return None
    elif shortfall.missing > 0.0:
        reason = (
            f"{margin[0]} {margin[1]:.6g} is {shortfall.missing:.3g} less than what a hold, "
            "readings, arithmetic and bus can take"
        )
        finding = Finding(reason, shortfall.state, NOT_COVERED)
    else:
        reason = f"undecided after {certificate.boxes} boxes"
        finding = Finding(reason, shortfall.state, f"give --boxes {10 * certificate.boxes}")
    if slips:
        change = f"take --formulas corrected; these formulas contain {', '.join(slips)}"
        return replace(finding, change=change)
    return finding


def _state(example: CounterExample) -> Mapping[str, float]:
    return {
        "core_K": example.core_temperature_K,
        "surface_K": example.surface_temperature_K,
        "coolant_K": example.coolant_temperature_K,
        "soc": example.soc,
        "current_A": example.current_A,
    }


def obstacles(
    preset: Preset, constants: Mapping[str, Any], fallback: Fallback
) -> tuple[Finding, ...]:
    """What leaves a charge of this preset no current, though it is safe: at its start, at its end.

    The constraints may hold the current at 0 A before the charge is complete.
    """
    found = (
        _voltage_before_completion(preset, constants),
        _soc_before_completion(preset, constants),
        _start(preset, constants, fallback),
    )
    return tuple(finding for finding in found if finding is not None)


def _voltage_before_completion(preset: Preset, constants: Mapping[str, Any]) -> Finding | None:
    limits, ocv = preset.limits, constants["ocv"]
    # Open-circuit voltages from which no current is allowed, and at completion.
    rest_V = constants["max_voltage_V"] - constants["voltage_margin_V"]
    reserve = constants["soc_error"]
    end_V = float(ocv(constants["completion_soc"] + reserve))
    if end_V < rest_V:
        return None
    last_soc = float(ocv.soc_at(rest_V)) - reserve
    needed_V = limits.max_voltage_V
    # The margin follows the limit, because it looks at the part of the table that limits.
    while needed_V - end_V <= _margin_V(preset, needed_V):
        needed_V = _up(end_V + _margin_V(preset, needed_V), VOLTAGE_STEP_V)
    change = f"raise limits.max_voltage_V to {needed_V:.3f}"
    if _down(last_soc, SOC_STEP) > 0.0:
        change += f" or lower limits.completion_soc to {_down(last_soc, SOC_STEP):.3f}"
    return Finding(
        f"the voltage limit leaves no current above a state of charge of {last_soc:.4f}, so that "
        f"limits.completion_soc {limits.completion_soc:g} is not reached",
        {"counted_soc": last_soc, "current_A": 0.0},
        change,
    )


def _margin_V(preset: Preset, max_voltage_V: float) -> float:
    limits = replace(preset.limits, max_voltage_V=max_voltage_V)
    return float(sampling_margins(preset.cell, replace(preset, limits=limits)).voltage_V)


def _soc_before_completion(preset: Preset, constants: Mapping[str, Any]) -> Finding | None:
    k, limits = constants, preset.limits
    reserved = (k["soc_uncertainty_per_s"] + k["soc_margin_per_s"]) / k["alpha1_per_s"]
    last_soc = k["max_soc"] - k["soc_error"] - reserved
    if k["completion_soc"] < last_soc:
        return None
    change = "reduce the errors of sensors.current_A and timing.delay_s"
    if _down(last_soc, SOC_STEP) > 0.0:
        change = f"lower limits.completion_soc to {_down(last_soc, SOC_STEP):.3f}"
    return Finding(
        f"the limit of charge leaves no current above a state of charge of {last_soc:.4f}, so that "
        f"limits.completion_soc {limits.completion_soc:g} is not reached",
        {"counted_soc": last_soc, "current_A": 0.0},
        change,
    )


def _start(preset: Preset, constants: Mapping[str, Any], fallback: Fallback) -> Finding | None:
    """At plug-in, with all temperatures equal and the preset's cooling."""
    initial, limits = preset.initial, preset.limits
    begin_K = initial.temperature_K
    reading = CellState(initial.soc, begin_K, begin_K, begin_K)
    cooling_W = initial.cooling_power_W
    lower_A, upper_A, _ = decide(constants, reading, cooling_W, limits.reference_current_A)
    if lower_A <= upper_A and lower_A < 0.0:
        return None
    coldest_K = min(
        limits.max_core_temperature_K - fallback.core_band_K,
        limits.max_surface_temperature_K - fallback.surface_band_K,
    )
    if begin_K <= coldest_K:
        return None
    change = (
        f"start at an initial.temperature_K of {_down(coldest_K, TEMPERATURE_STEP_K):.1f} or less"
    )
    if coldest_K <= preset.operating_box.surface_temperature_K[0]:
        change = (
            "shorten timing.delay_s and timing.sampling_period_s, or reduce the errors of "
            "sensors.surface_temperature_K: the margins leave nothing of the operating box"
        )
    return Finding(
        "at plug-in no current is safe, because the temperature limits are too near",
        {"soc": initial.soc, "temperature_K": begin_K, "cooling_power_W": cooling_W},
        change,
    )


def _up(value: float, step: float) -> float:
    return step * (math.floor(value / step) + 1)


def _down(value: float, step: float) -> float:
    return step * (math.ceil(value / step) - 1)
