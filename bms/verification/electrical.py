"""Voltage and state of charge over one decision: one dimension, shown on a fine partition."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bms.barrier.margins import soc_error_bound
from bms.bus_signals import BusQuantisation
from bms.presets import Preset
from bms.verification.certificate import Certificate

PARTS = 200_000
CURRENT_ERROR_A = 1e-3
"""How far the float32 limits by voltage and charge may lie from exact ones (test_rcbf.py)."""
ROUNDING_V = 1e-9
"""Far above the float64 rounding of the few operations on numbers of some volts."""


def certify_voltage(preset: Preset, constants: Mapping[str, Any]) -> tuple[Certificate, float]:
    """Certificate, and the least distance to the voltage limit in V, over all counted charges.

    For counted charge in [a, b] the current is at most what the constraint allows at a; at the end
    of the hold the charge is at most b, its error, and what came in meanwhile.
    """
    cell, limits = preset.cell, preset.limits
    strongest_A = -limits.reference_current_A
    edges = np.linspace(0.0, limits.completion_soc, PARTS + 1)
    a, b = edges[:-1], edges[1:]
    allowed_A = (constants["max_voltage_V"] - constants["voltage_margin_V"] - cell.ocv(a)) / (
        constants["ohmic_resistance_ohm"]
    )
    current_A = np.clip(allowed_A + CURRENT_ERROR_A, 0.0, strongest_A)
    end_soc = b + _charge_error(preset) + _taken_up(preset, current_A)
    distance_V = (
        limits.max_voltage_V - cell.ocv(end_soc) - cell.ohmic_resistance_ohm * current_A
    ) - ROUNDING_V
    # Complete or without a safe current, the cell rests at its open-circuit voltage.
    resting_V = limits.max_voltage_V - cell.ocv.voltage_V[-1]
    open_boxes = int(np.count_nonzero(distance_V < 0.0)) + int(resting_V < 0.0)
    certificate = Certificate("voltage", PARTS, open_boxes)
    return certificate, float(min(np.min(distance_V), resting_V))


def certify_soc(preset: Preset, constants: Mapping[str, Any]) -> Certificate:
    """State of charge: B2' >= -alpha1 B2 at the true charge throughout the hold.

    The decision leaves u/C + alpha1 (s_max - counted) >= margin; the counted charge differs from
    the true one at any instant of the hold by the counting error and what has come in since.
    """
    strongest_A = -preset.limits.reference_current_A
    moved = _charge_error(preset) + _taken_up(preset, strongest_A)
    alpha1, capacity_As = constants["alpha1_per_s"], preset.cell.capacity_As
    reserve = constants["soc_margin_per_s"] - alpha1 * moved - CURRENT_ERROR_A / capacity_As
    # Up to completion the charge may also simply be too far from its limit to get there.
    far = preset.limits.completion_soc + moved < preset.limits.max_soc
    held = reserve >= 0.0 and constants["soc_uncertainty_per_s"] >= preset.uncertainty.soc_per_s
    return Certificate("soc", 1, 0 if held or far else 1)


def _charge_error(preset: Preset) -> float:
    return soc_error_bound(preset.cell, preset, BusQuantisation())


def _taken_up(preset: Preset, current_A: Any) -> Any:
    """Charge taken up until the hold ends: before it acts at any current, then at the decided."""
    timing, strongest_A = preset.timing, -preset.limits.reference_current_A
    held_s = timing.sampling_period_s + timing.delay_s
    # A decision that acts at once may act until the end of the hold; one that is delayed follows
    # another. The greater of both is the delayed one, for no current is above the strongest.
    charge_As = timing.delay_s * strongest_A + timing.sampling_period_s * current_A
    return charge_As / preset.cell.capacity_As + held_s * preset.uncertainty.soc_per_s
