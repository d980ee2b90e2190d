"""What float32 arithmetic in the firmware can take from the thermal constraints.

Every term of a left-hand side is rounded a few times on its way (coefficient, difference, product,
sums, root, and the current itself), each time by at most half a unit in the last place. So the
exact left-hand side at the decided current falls short of what the firmware took it for by no more
than ROUNDINGS such units of the largest that its terms can be.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bms.barrier.constants import barrier_constants
from bms.cell import CellParameters
from bms.presets.schema import Preset

UNIT = 2.0**-24
"""Largest relative error of rounding to float32."""
ROUNDINGS = 16


def rounding_allowances(cell: CellParameters, preset: Preset) -> tuple[Any, Any]:
    """Allowances of the core (K/s) and the surface constraint (K/s^2) within the operating box.

    The estimation error counts as one more difference of temperatures.
    """
    a, gains, box = barrier_constants(cell, preset), preset.gains, preset.operating_box
    hottest_K = max(box.surface_temperature_K[1], preset.limits.max_core_temperature_K)
    span_K = hottest_K - min(box.coolant_temperature_K[0], box.surface_temperature_K[0])
    current_A, cooling_W = -preset.limits.reference_current_A, box.cooling_power_W[1]
    heat_K = (hottest_K + span_K) * current_A
    core = (
        (2.0 * a.a1_per_s + 2.0 * gains.core_gain_per_s(cell)) * span_K
        + preset.uncertainty.core_K_per_s
        + np.abs(a.a2_per_As) * heat_K
        + a.a3_K_per_A2s * current_A**2
    )
    surface = (
        (2.0 * np.abs(a.a4_per_s2) + np.abs(a.a6_per_s2) + gains.alpha3_per_s2) * span_K
        + a.a10_K_per_Ws2 * cooling_W
        + a.delta4_K_per_s2
        + np.abs(a.a8_per_As2) * heat_K
        + np.abs(a.a9_K_per_A2s2) * current_A**2
    )
    return ROUNDINGS * UNIT * core, ROUNDINGS * UNIT * surface
