"""Charges of the cell model whose whole course is known, for the tests of the bound."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bms.cell import CellState, at_rest_V
from bms.cell.integrator import integrate_step
from bms.cell.model import terminal_voltage_V
from bms.cell.polarisation import polarisation_after_V
from bms.studies.optimum.ranges import map_current_A

STEP_S = 0.5


class Course(NamedTuple):
    """Currents (N,) in A, and the states (N + 1,) at the ends of their steps."""

    current_A: np.ndarray
    soc: np.ndarray
    core_K: np.ndarray
    surface_K: np.ndarray
    keeps_limits: bool


def played(charge, current_A):
    """The course of charging currents (N,) in A, by the plain cell model."""
    cell, limits = charge.cell, charge.limits
    state, volts = CellState(charge.start_soc, *[charge.start_K] * 3), at_rest_V(cell)
    rows, kept = [state], bool(np.all(np.asarray(current_A) <= charge.strongest_A))
    for strength_A in current_A.tolist():
        if charge.current_map is not None:
            at = np.array([state.surface_temperature_K]), np.array([state.soc])
            kept = kept and strength_A <= map_current_A(charge.current_map, *at)[0]
        before_V = volts
        volts = polarisation_after_V(cell, volts, -strength_A, STEP_S)
        after = integrate_step(
            cell, state, -strength_A, charge.cooling_W, STEP_S, polarisation_V=before_V
        )
        state = CellState(*map(float, after))
        voltage_V = terminal_voltage_V(
            cell, state.soc, -strength_A, state.core_temperature_K, volts
        )
        kept = (
            kept
            and voltage_V <= limits.max_voltage_V
            and state.core_temperature_K <= limits.max_core_temperature_K
            and state.surface_temperature_K <= limits.max_surface_temperature_K
        )
        rows.append(state)
    soc, core_K, surface_K, _ = np.array(rows).T
    return Course(current_A, soc, core_K, surface_K, bool(kept))


def strongest_courses(charge, duration_s):
    """Courses of several shapes, each as strong as the limits allow."""
    count = round(duration_s / STEP_S)
    time_s = STEP_S * np.arange(count)
    ramp_A = np.full(count, charge.strongest_A)
    if charge.growth_A_per_s is not None:
        ramp_A = charge.growth_A_per_s * (time_s + charge.period_s)
    for shape in (
        np.ones(count),
        np.linspace(1.2, 0.8, count),
        np.where(time_s < 0.3 * duration_s, 1.5, 0.8),
        np.where(time_s < 0.2 * duration_s, 0.1, 1.0),
    ):
        low, high, best = 0.0, 2.0 * charge.strongest_A, None
        for _ in range(9):
            middle = 0.5 * (low + high)
            shaped_A = np.minimum(np.minimum(middle * shape, charge.strongest_A), ramp_A)
            # A step up in the middle has no ramp: those shapes are for charges without one.
            grows_A = np.max(np.diff(shaped_A))
            course = played(charge, shaped_A)
            is_ramp = charge.growth_A_per_s is None or (
                grows_A <= charge.growth_A_per_s * STEP_S + 1e-9
            )
            if course.keeps_limits and is_ramp:
                low, best = middle, course
            else:
                high = middle
        if best is not None:
            yield best


def full_at_its_end(charge, course):
    """The charge, complete at the state of charge in which the course ends."""
    return replace(charge, limits=replace(charge.limits, completion_soc=float(course.soc[-1])))
