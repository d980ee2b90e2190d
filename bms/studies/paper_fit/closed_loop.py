"""Charges of many candidate cells at once with KAN-rCBF and S-CBF, reduced to the paper's figures.

The estimator is taken as exact, with its error bound still subtracted in the constraints: the
error itself moves the peak by less than the tolerance of the fit, and a fit must not depend on a
network that is trained on its result.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from bms.barrier import barrier_constants, constraints, sampling_margins
from bms.baselines import s_cbf
from bms.cell import CellParameters, CellState, integrate_step
from bms.presets import Preset

HORIZON_S = 1000.0


class Charge(NamedTuple):
    """Figures of one charge, or arrays of them: peaks, time to full, time of the first derating,
    and by how much a derated charging current grew again.

    A charge that is not full within the horizon has a time beyond it, by what is missing.
    """

    core_peak_K: Any
    surface_peak_K: Any
    time_s: Any
    first_derate_s: Any
    regrowth_A: Any


class Start(NamedTuple):
    """State at plug-in and cooling power; floats or arrays."""

    soc: Any
    temperature_K: Any
    cooling_power_W: Any


Policy = Callable[[CellState], Any]


def charge_with_robust_barriers(
    cell: CellParameters, preset: Preset, start: Start, error_bound_K: float, period_s: float
) -> Charge:
    """Charge with the four robust barriers and the preset's margins for sampling."""
    constants = barrier_constants(cell, preset)
    margins = sampling_margins(cell, preset)

    def policy(state: CellState) -> Any:
        return constraints.charging_current_A(
            cell, preset, constants, margins, state, start.cooling_power_W, error_bound_K
        )

    growth_A = preset.limits.current_growth_A_per_s * period_s
    return _charge(cell, preset, start, policy, period_s, growth_A)


def charge_with_surface_barrier(
    cell: CellParameters, preset: Preset, start: Start, period_s: float
) -> Charge:
    """Charge with the cascade of the baseline."""
    constants = barrier_constants(cell, preset)

    def policy(state: CellState) -> Any:
        wanted_A = preset.limits.reference_current_A
        stages = s_cbf.cascade(cell, preset, constants, state, start.cooling_power_W, wanted_A)
        return s_cbf.charging_current_A(stages, wanted_A)

    return _charge(cell, preset, start, policy, period_s, np.inf)


def _charge(
    cell: CellParameters,
    preset: Preset,
    start: Start,
    policy: Policy,
    period_s: float,
    growth_A: float,
) -> Charge:
    limits = preset.limits
    soc, temperature_K = np.broadcast_arrays(
        np.asarray(start.soc, dtype=np.float64), np.asarray(start.temperature_K, dtype=np.float64)
    )
    state = CellState(soc, temperature_K, temperature_K, temperature_K)
    core_peak_K = surface_peak_K = temperature_K
    full_s = np.full(soc.shape, np.inf)
    derate_s = np.full(soc.shape, np.inf)
    smallest_A = np.full(soc.shape, np.inf)
    regrowth_A = np.zeros(soc.shape)
    current_A = np.zeros(soc.shape)
    for step in range(round(HORIZON_S / period_s)):
        time_s = step * period_s
        wanted_A = np.maximum(limits.reference_current_A, current_A - growth_A)
        allowed_A = policy(state)
        derated = allowed_A > wanted_A
        derate_s = np.where(np.isinf(derate_s) & derated, time_s, derate_s)
        current_A = np.where(derated, allowed_A, wanted_A)
        before = state.soc
        state = integrate_step(cell, state, current_A, start.cooling_power_W, period_s)
        charging = np.isinf(full_s)
        counted = charging & np.isfinite(derate_s)
        smallest_A = np.where(counted, np.minimum(smallest_A, -current_A), smallest_A)
        regrowth_A = np.where(counted, np.maximum(regrowth_A, -current_A - smallest_A), regrowth_A)
        core_peak_K = np.where(
            charging, np.maximum(core_peak_K, state.core_temperature_K), core_peak_K
        )
        surface_peak_K = np.where(
            charging, np.maximum(surface_peak_K, state.surface_temperature_K), surface_peak_K
        )
        reached = charging & (state.soc >= limits.completion_soc)
        if np.any(reached):
            part = (limits.completion_soc - before) / np.where(reached, state.soc - before, 1.0)
            full_s = np.where(reached, time_s + part * period_s, full_s)
        if np.all(np.isfinite(full_s)):
            break
    missing = np.maximum(limits.completion_soc - state.soc, 0.0)
    return Charge(
        core_peak_K,
        surface_peak_K,
        np.where(np.isinf(full_s), HORIZON_S * (1.0 + missing), full_s),
        np.where(np.isinf(derate_s), HORIZON_S, derate_s),
        regrowth_A,
    )
