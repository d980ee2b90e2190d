"""How warm the coolant of a family's cell may be, so that no limit is reached without a current.

Without a current, core, surface and coolant are a linear system whose matrix has no negative entry
off its diagonal: what is at or below a state that the largest disturbances do not raise stays at
or below it. Such a state has the core at its limit, the surface below that by what the core's
disturbance makes of Rc, and the coolant below the surface by what both disturbances make of Rs;
the cooling has to take their heat up. Beside a warmer coolant the disturbances alone may take a
cell over a limit, and a current that flowed before adds to it.
"""

from __future__ import annotations

from bms.presets import Preset
from bms.verification.family_constants import corners


def warmest_coolant_K(preset: Preset) -> float:
    """Coolant temperature in K up to which 0 A keeps every cell of the family within its limits."""
    noise, limits = preset.uncertainty, preset.limits
    below_K = max(
        corner["core_resistance"] * core_W
        + corner["surface_resistance"]
        * (core_W + corner["surface_heat_capacity"] * noise.surface_K_per_s)
        for corner in corners(preset)
        for core_W in [corner["core_heat_capacity"] * noise.core_K_per_s]
    )
    return min(limits.max_core_temperature_K, limits.max_surface_temperature_K) - below_K
