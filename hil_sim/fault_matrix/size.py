"""What of a preset the figures of a row's fault are multiplied with, so that they fit its cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, get_args

from bms.barrier.family import polarisation_ohm
from bms.calibration.plausibility import plausibility_fields
from bms.presets import Preset
from hil_sim.faults.base import Fault

Size = Literal["current-deviation", "voltage-deviation", "cooling-box", "cooling-step"]
_FIGURES = ("offset", "rate_per_s", "amplitude")
_FIGURES_FOR_V = 0.2
"""Permitted deviation of the voltage for which the matrix has its figures, and the least of all."""
_MIDDLE_SOC = (0.1, 0.9)


def sized(fault: Fault, size: Size | None, preset: Preset) -> Fault:
    """The fault with its figures for this preset."""
    if size is None:
        return fault
    factor = _SIZES[size](preset)
    figures: dict[str, Any] = {
        name: factor * getattr(fault, name) for name in _FIGURES if hasattr(fault, name)
    }
    return replace(fault, **figures)


def strongest_A(preset: Preset) -> float:
    """The strongest current that the preset's charge ever asks for, as a positive number."""
    reference_A = -preset.limits.reference_current_A
    if preset.current_map is None:
        return reference_A
    return min(reference_A, max(map(max, preset.current_map.largest_A)))


def _current_deviation(preset: Preset) -> float:
    """Ampere by which the measured current may miss the command."""
    return float(plausibility_fields(preset)["current_deviation_A"])


def _voltage_deviation(preset: Preset) -> float:
    """How far beyond what it may read a voltage has to be, of what the matrix has figures for."""
    permitted_V = float(plausibility_fields(preset)["voltage_deviation_V"])
    return max(1.0, (permitted_V + _family_spread_V(preset)) / _FIGURES_FOR_V)


def _family_spread_V(preset: Preset) -> float:
    """By how much two cells of the family differ in voltage at the strongest current; else 0."""
    cell = preset.cell
    if cell.interval is None:
        return 0.0
    low_ohm, high_ohm = (factor * cell.ohmic_resistance_ohm for factor in cell.interval.resistance)
    spread_ohm = high_ohm - low_ohm + polarisation_ohm(cell, cell.interval)
    low_soc, high_soc = _MIDDLE_SOC
    slope_V = (float(cell.ocv(high_soc)) - float(cell.ocv(low_soc))) / (high_soc - low_soc)
    return (
        strongest_A(preset) * spread_ohm
        + 2.0 * cell.interval.ocv_error_V
        + 2.0 * preset.plug_in.soc_error * slope_V
    )


def _cooling_box(preset: Preset) -> float:
    """Width in W of the box that the estimator was trained for."""
    low_W, high_W = preset.operating_box.cooling_power_W
    return high_W - low_W


def _cooling_step(preset: Preset) -> float:
    return min(1.0, _cooling_box(preset))


_SIZES: dict[Size, Callable[[Preset], float]] = {
    "current-deviation": _current_deviation,
    "voltage-deviation": _voltage_deviation,
    "cooling-box": _cooling_box,
    "cooling-step": _cooling_step,
}
assert set(_SIZES) == set(get_args(Size))
