"""S-CBF as one program in the current, with the reversible heat that the cascade has to leave out.

The paper says that both forms behave alike. Without reversible heat they are the same program,
because the heat R0 u^2 rises with the charging current; so what this form shows is what the
simplification costs. True states and no margins, as in the cascade.
"""

from __future__ import annotations

import math
from dataclasses import replace

from bms.barrier import barrier_constants
from bms.barrier.constraints import left_hand_sides, quadratic_interval
from bms.cell import CellState
from bms.decision import INVALID, ConstraintMargins, Decision, Observation
from bms.presets import Preset
from bms.presets.schema import Uncertainty

_NO_UNCERTAINTY = Uncertainty(
    soc_per_s=0.0,
    core_K_per_s=0.0,
    surface_K_per_s=0.0,
    coolant_K_per_s=0.0,
    surface_rate_K_per_s2=0.0,
)


class SingleStepSurfaceBarrierController:
    """Current nearest to the reference under voltage, SoC and surface barriers of one cell."""

    name = "s-cbf-single-step"

    def __init__(self, preset: Preset) -> None:
        """Controller for a preset's cell, limits and gains; its uncertainty is not regarded."""
        self._preset = replace(preset, uncertainty=_NO_UNCERTAINTY)
        self._constants = barrier_constants(preset.cell, self._preset)

    def decide(self, observation: Observation) -> Decision:
        """Charging current for the next period; 0 A and "invalid" for input that is not finite.

        The method has no core constraint: that margin is always infinite.
        """
        state = CellState(*observation[:4])
        cooling_power_W = observation.cooling_power_W
        if not all(map(math.isfinite, (*state, cooling_power_W, observation.reference_current_A))):
            return INVALID
        preset, cell, constants = self._preset, self._preset.cell, self._constants
        rest = left_hand_sides(cell, preset, constants, state, cooling_power_W, 0.0)
        surface_low_A, surface_high_A = quadratic_interval(
            -constants.a9_K_per_A2s2,
            constants.a8_per_As2 * state.core_temperature_K,
            rest.surface_K_per_s2,
        )
        strongest_A = preset.limits.reference_current_A
        lower_ends_A = {
            "none": min(max(observation.reference_current_A, strongest_A), 0.0),
            "voltage": -float(rest.voltage_V) / cell.ohmic_resistance_ohm,
            "soc": -rest.soc_per_s * cell.capacity_As,
            "surface": float(surface_low_A),
        }
        active = max(lower_ends_A, key=lower_ends_A.__getitem__)
        lower_A, upper_A = lower_ends_A[active], min(0.0, float(surface_high_A))
        feasible = lower_A <= upper_A
        current_A = lower_A if feasible else 0.0
        margins = left_hand_sides(cell, preset, constants, state, cooling_power_W, current_A)
        return Decision(
            current_A=current_A,
            feasible=feasible,
            active_constraint=active if feasible else "infeasible",
            lower_A=lower_A,
            upper_A=upper_A,
            margins=ConstraintMargins(*map(float, margins))._replace(core_K_per_s=math.inf),
        )
