"""Voltage and state of charge over one decision: piecewise linear in the counted charge.

Margins and certificates share what a hold brings and what counting, arithmetic and bus can take
(bms/barrier). The certificates do not use how the margins are put together: they follow each
decision by the firmware's own constants to the end of its hold.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.barrier.margins import charge_taken_up, decision_allowances, strongest_current_A
from bms.barrier.readings import soc_error_bound
from bms.barrier.rounding import ARITHMETIC_ROUNDINGS
from bms.bus_signals import BUS
from bms.presets import Preset
from bms.verification.certificate import Certificate, Shortfall

ROUNDING_V = 1e-9
"""Far above the float64 rounding of the few operations on numbers of some volts."""


def certify_voltage(preset: Preset, constants: Mapping[str, Any]) -> tuple[Certificate, float]:
    """Certificate, and the least distance to the limit in V (infinite where nothing charges).

    For counted charge a, the current is what the constraint allows at a and the firmware's reserve;
    at the end of the hold the true charge is at most a, its error, and what came in meanwhile. The
    voltage is linear in a between the points where any part of this has a kink, so it is highest at
    one of them. Where no current is allowed the cell rests, at a charge to which a decision below
    has brought it.
    """
    cell, ocv, limits = preset.cell, constants["ocv"], preset.limits
    resistance_ohm = constants["ohmic_resistance_ohm"]
    strongest_A = strongest_current_A(preset, BUS)
    full_V = (
        constants["max_voltage_V"]
        - constants["voltage_margin_V"]
        + decision_allowances(cell, preset, BUS, ARITHMETIC_ROUNDINGS).voltage_V
    )
    if not np.isfinite(full_V):
        return Certificate("voltage", 1, 1, shortfall=Shortfall({}, full_V)), full_V
    if full_V <= ocv.voltage_V[0]:
        return Certificate("voltage", 1, 0), np.inf
    error, reserve = soc_error_bound(cell, preset), constants["soc_error"]

    def current_A(counted: Array) -> Array:
        free_V = full_V - ocv(counted + reserve)
        return np.asarray(np.clip(free_V / resistance_ohm, 0.0, strongest_A))

    def end_soc(counted: Array) -> Array:
        taken_up = charge_taken_up(cell, preset, BUS, current_A(counted))
        return np.asarray(counted + error + taken_up)

    rests_at = float(ocv.soc_at(full_V)) - reserve
    if full_V >= ocv.voltage_V[-1]:
        rests_at = np.inf
    last = min(rests_at, constants["completion_soc"])
    limits_at = (*ocv.soc, float(ocv.soc_at(full_V - resistance_ohm * strongest_A)))
    kinks = [*(kink - reserve for kink in limits_at), 0.0, last]
    counted = np.unique([kink for kink in kinks if 0.0 <= kink <= last])
    counted = np.concatenate([counted, _crossings(counted, end_soc(counted), cell.ocv.soc)])
    current, end = current_A(counted), end_soc(counted)
    distance_V = limits.max_voltage_V - cell.ocv(end) - cell.ohmic_resistance_ohm * current
    nearest = int(np.argmin(distance_V))
    open_points = int(np.count_nonzero(~(distance_V >= ROUNDING_V)))
    state = {
        "counted_soc": float(counted[nearest]),
        "current_A": -float(current[nearest]),
        "soc_at_end": float(end[nearest]),
    }
    least_V = float(distance_V[nearest])
    return Certificate(
        "voltage",
        len(counted),
        open_points,
        shortfall=Shortfall(state, ROUNDING_V - least_V) if open_points else None,
    ), least_V


def certify_soc(preset: Preset, constants: Mapping[str, Any]) -> Certificate:
    """State of charge: B2' >= -alpha1 B2 at the true charge throughout the hold.

    The decision leaves u/C + alpha1 (s_max - counted) >= margin; the counted charge differs from
    the true one at any instant of the hold by the counting error and what has come in since.
    """
    k, cell, limits = constants, preset.cell, preset.limits
    strongest_A = strongest_current_A(preset, BUS)
    moved = soc_error_bound(cell, preset) + charge_taken_up(cell, preset, BUS, strongest_A)
    alpha1 = preset.gains.alpha1_per_s
    # Required less decided condition, coefficient by coefficient, at the worst end of each range.
    gain = alpha1 - k["alpha1_per_s"]
    left = (
        k["soc_margin_per_s"]
        + (k["soc_uncertainty_per_s"] - preset.uncertainty.soc_per_s)
        + min(0.0, strongest_A * (1.0 / k["capacity_As"] - 1.0 / cell.capacity_As))
        + min(gain * limits.max_soc, gain * (limits.max_soc - limits.completion_soc))
        - k["alpha1_per_s"] * (k["max_soc"] - limits.max_soc)
        - alpha1 * (moved - k["soc_error"])
        - decision_allowances(cell, preset, BUS, ARITHMETIC_ROUNDINGS).soc_per_s
    )
    # Up to completion the charge may also simply be too far from its limit to get there.
    far = k["completion_soc"] + moved < limits.max_soc
    if left >= 0.0 or far:
        return Certificate("soc", 1, 0)
    state = {"counted_soc": limits.completion_soc, "current_A": -strongest_A}
    return Certificate("soc", 1, 1, shortfall=Shortfall(state, float(-left)))


def _crossings(counted: Array, end: Array, points: tuple[float, ...]) -> Array:
    """Counted charges at which the hold ends at a point of the table, between those given."""
    steps, rises = np.diff(counted)[:, None], np.diff(end)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (np.asarray(points) - end[:-1, None]) / rises
    inside = (share > 0.0) & (share < 1.0)
    return np.asarray((counted[:-1, None] + share * steps)[inside])
