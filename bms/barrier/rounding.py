"""What float32 arithmetic in the firmware can take from the four constraints.

Every term of a left-hand side is rounded a few times on its way (constant, difference, product,
sums, root, and the current itself), each time by at most half a unit in the last place. So the
exact left-hand side at the decided current falls short of what the firmware took it for by no more
than ROUNDINGS such units of the largest that its terms can be.
"""

from __future__ import annotations

import numpy as np

from bms.barrier.constants import barrier_constants
from bms.cell import CellParameters
from bms.decision import ConstraintMargins
from bms.presets.schema import Preset

UNIT = 2.0**-24
"""Largest relative error of rounding to float32."""
ARITHMETIC_ROUNDINGS = 13
"""Of a decision by constants as they are in the firmware."""
CONSTANT_ROUNDINGS = 3
"""Of the constants themselves, with sums of two."""
ROUNDINGS = ARITHMETIC_ROUNDINGS + CONSTANT_ROUNDINGS


def rounding_allowances(
    cell: CellParameters, preset: Preset, roundings: int = ROUNDINGS
) -> ConstraintMargins:
    """Allowances of the four constraints within the operating box (V, 1/s, K/s, K/s^2).

    The estimation error counts as one more difference of temperatures. Rounding of the counted
    charge is in its own error bound.
    """
    a, gains, box = barrier_constants(cell, preset), preset.gains, preset.operating_box
    limits = preset.limits
    hottest_K = max(box.surface_temperature_K[1], limits.max_core_temperature_K)
    span_K = hottest_K - min(box.coolant_temperature_K[0], box.surface_temperature_K[0])
    current_A, cooling_W = -limits.reference_current_A, box.cooling_power_W[1]
    heat_K = (hottest_K + span_K) * current_A
    voltage = limits.max_voltage_V + cell.ocv.voltage_V[-1] + cell.ohmic_resistance_ohm * current_A
    soc = (
        gains.alpha1_per_s * limits.max_soc
        + preset.uncertainty.soc_per_s
        + current_A / cell.capacity_As
    )
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
    return ConstraintMargins(
        *(roundings * UNIT * largest for largest in (voltage, soc, core, surface))
    )
