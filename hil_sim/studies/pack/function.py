"""Constants of a pack's state of function: what the time ahead makes of the present readings.

docs/pack.md has the derivation of each. The bounds hold for every cell of a spread.
"""

from __future__ import annotations

import math

from bms.barrier.readings import reading_errors
from bms.cell import CellFactors, scaled
from bms.presets import Preset
from hil_sim.studies.pack.coupling import greatest_heat_W
from hil_sim.studies.pack.reserves import ESTIMATE_ERROR_K
from hil_sim.studies.pack.spread import Spread, Surroundings

SOON_S = 10.0
"""How far ahead the second of the two currents is promised."""
UNKNOWN: dict[str, float] = {}
"""Members of a pack_horizon_t that allows 0 A."""
_ANY_CORE_K = 1000.0
"""Above any estimate: the core is taken to be at its limit."""


def horizons(
    preset: Preset, spread: Spread, around: Surroundings, e_max_K: float, all_seen: bool
) -> list[dict[str, float]]:
    """Members of pack_horizon_t for a decision's hold and for SOON_S; a family has none.

    `e_max_K` bounds the error of the core's estimate; without a thermistor at each cell
    (`all_seen`) no bound on a core is taken from it.
    """
    if preset.cell.interval is not None:
        return [UNKNOWN, UNKNOWN]
    above_K = e_max_K + ESTIMATE_ERROR_K if all_seen else _ANY_CORE_K
    held_s = preset.timing.sampling_period_s + preset.timing.delay_s
    return [_horizon(preset, spread, around, time_s, above_K) for time_s in (held_s, SOON_S)]


def _horizon(
    preset: Preset, spread: Spread, around: Surroundings, time_s: float, above_K: float
) -> dict[str, float]:
    fast = scaled(
        preset.cell,
        CellFactors(
            core_resistance=spread.core_resistance[0],
            core_heat_capacity=spread.core_heat_capacity[0],
            surface_resistance=spread.surface_resistance[1],
        ),
    )
    rc, rs = fast.core_resistance_K_per_W, fast.surface_resistance_K_per_W
    least_rs = preset.cell.surface_resistance_K_per_W * spread.surface_resistance[0]
    conductance = 1.0 / rc + 1.0 / rs
    settling_s = fast.surface_heat_capacity_J_per_K / conductance
    gone = 1.0 - math.exp(-time_s / settling_s)
    per_core, per_coolant = (share / conductance for share in (1.0 / rc, 1.0 / rs))
    taken_up = time_s / (least_rs * fast.coolant_heat_capacity_J_per_K)
    errors, bounds = reading_errors(preset), preset.uncertainty
    uneven_K = greatest_heat_W(preset, spread) / around.flow_W_per_K
    return {
        "horizon_s": time_s,
        "core_above_estimate_K": above_K,
        "core_K_per_W": time_s / fast.core_heat_capacity_J_per_K,
        "core_K": time_s * bounds.core_K_per_s,
        "surface_per_core": gone * per_core,
        "surface_per_coolant": gone * per_coolant,
        "surface_per_warmer_coolant": gone * per_coolant * rs / least_rs,
        "surface_K": errors.surface_K + gone * settling_s * bounds.surface_K_per_s,
        "coolant_per_core": taken_up * per_core / (1.0 - taken_up * per_coolant),
        "coolant_per_surface": taken_up,
        "coolant_K": errors.coolant_K + uneven_K + time_s * bounds.coolant_K_per_s,
    }
