"""What each slip costs in a charge: the same cell, decided by constants with and without it.

Eight charges run side by side: from the preset's start and from a hot one without cooling, each
undisturbed with true readings, and with disturbances at their heating bounds, surface and coolant
readings off to the side that lets most current through the core constraint, and the core estimate
low, true and high by its bound.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.barrier.margins import soc_error_bound
from bms.bus_signals import BusQuantisation
from bms.cell import CellState, Disturbance, integrate_step, terminal_voltage_V
from bms.model.model_file import KanModel
from bms.presets import Preset
from bms.verification.conditions import firmware_constants, reading_errors
from bms.verification.decision import decide
from bms.verification.slips import Slip, with_slips

HOT_START_BELOW_LIMIT_K = 8.0
HORIZON_S = 1800.0
ESTIMATES = np.array([0.0, -1.0, 0.0, 1.0] * 2)
DISTURBED = np.array([0.0, 1.0, 1.0, 1.0] * 2)
HOT = np.array([False] * 4 + [True] * 4)
NOMINAL = 0


@dataclass(frozen=True)
class SlipCost:
    """Largest excess over each limit (negative: room left) and the undisturbed charge.

    charge_time_s is None when the undisturbed charge is not complete within the horizon; soc is
    what it reached then. The excess is over all eight charges.
    """

    slip: str
    certified: bool
    core_excess_K: float
    surface_excess_K: float
    voltage_excess_V: float
    charge_time_s: float | None
    soc: float
    core_peak_K: float
    surface_peak_K: float


def slip_cost(
    preset: Preset,
    model: KanModel,
    slips: tuple[Slip, ...],
    certified: bool,
    horizon_s: float = HORIZON_S,
) -> SlipCost:
    """Run the eight charges with slips in the constants, for horizon_s seconds at most."""
    constants = with_slips(preset, firmware_constants(preset, model), slips)
    name = "+".join(slip.name for slip in slips) or "none"
    return _charges(preset, constants, name, certified, horizon_s)


def _charges(
    preset: Preset,
    constants: Mapping[str, Any],
    name: str,
    certified: bool,
    horizon_s: float,
) -> SlipCost:
    cell, limits, timing = preset.cell, preset.limits, preset.timing
    errors, bounds, period_s = reading_errors(preset), preset.uncertainty, timing.sampling_period_s
    hot_K = limits.max_surface_temperature_K - HOT_START_BELOW_LIMIT_K
    start_K = np.where(HOT, hot_K, preset.initial.temperature_K)
    state = CellState(np.full(8, preset.initial.soc), start_K, start_K, start_K)
    cooling_W = np.where(HOT, 0.0, preset.initial.cooling_power_W)
    disturbance = Disturbance(
        DISTURBED * bounds.soc_per_s,
        DISTURBED * bounds.core_K_per_s,
        DISTURBED * bounds.surface_K_per_s,
        DISTURBED * bounds.coolant_K_per_s,
    )
    estimation_K = ESTIMATES * constants["estimation_error_bound_K"]
    counting = DISTURBED * soc_error_bound(cell, preset, BusQuantisation())
    current_A = np.zeros(8)
    peaks = [start_K, start_K, np.full(8, -np.inf)]
    done_s = np.full(8, np.inf)
    for step in range(round(horizon_s / period_s)):
        complete = state.soc - counting >= limits.completion_soc
        done_s = np.where(complete & np.isinf(done_s), step * period_s, done_s)
        if np.all(complete):
            break
        reading = CellState(
            state.soc - counting,
            state.core_temperature_K + estimation_K,
            state.surface_temperature_K - DISTURBED * errors.surface_K,
            state.coolant_temperature_K - DISTURBED * errors.coolant_K,
        )
        wanted_A = np.maximum(
            limits.reference_current_A, current_A - limits.current_growth_A_per_s * period_s
        )
        lower_A, upper_A, _ = decide(preset, constants, reading, cooling_W, wanted_A)
        current_A = np.where((lower_A <= upper_A) & ~complete, lower_A, 0.0)
        state = integrate_step(cell, state, current_A, cooling_W, period_s, disturbance)
        voltage_V = terminal_voltage_V(cell, state.soc, current_A)
        values = (state.core_temperature_K, state.surface_temperature_K, voltage_V)
        peaks = [np.maximum(peak, value) for peak, value in zip(peaks, values)]
    return SlipCost(
        slip=name,
        certified=certified,
        core_excess_K=float(np.max(peaks[0])) - limits.max_core_temperature_K,
        surface_excess_K=float(np.max(peaks[1])) - limits.max_surface_temperature_K,
        voltage_excess_V=float(np.max(peaks[2])) - limits.max_voltage_V,
        charge_time_s=float(done_s[NOMINAL]) if np.isfinite(done_s[NOMINAL]) else None,
        soc=float(state.soc[NOMINAL]),
        core_peak_K=float(peaks[0][NOMINAL]),
        surface_peak_K=float(peaks[1][NOMINAL]),
    )
