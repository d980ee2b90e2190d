"""CC-CV: constant current, then constant voltage, cut back when the surface gets warm.

What most chargers do: the reference current until the cell reaches its charging voltage, then
whatever current holds that voltage. The current is cut back in proportion between two surface
temperatures, which is the usual protection of a pack. Measured voltage, current and surface
temperature only; no model but the cell's ohmic resistance, no estimate of the core.
"""

from __future__ import annotations

from dataclasses import dataclass

from bms.baselines.measured_cell import charging_voltage_V, current_at_A, usable
from bms.decision import INVALID, NO_MARGINS, Decision, Observation
from bms.presets import Preset

CUT_BACK_SPAN_K = 5.0
"""The cut-back begins this far below the surface limit: 45 degC for a limit of 50 degC."""


TAIL_HOURS = 20.0
"""The cell is full once the charging voltage needs no more than its capacity over this time."""
REACHED_V = 0.005
"""How far below it the voltage counts as the charging voltage."""


@dataclass(frozen=True)
class CutBack:
    """Share of the current: 1 up to begin_K of the surface, 0 from end_K, linear between."""

    begin_K: float
    end_K: float

    def share(self, surface_temperature_K: float) -> float:
        """Share of the full current, 0..1."""
        left = (self.end_K - surface_temperature_K) / (self.end_K - self.begin_K)
        return min(max(left, 0.0), 1.0)


def tail_current_A(preset: Preset) -> float:
    """Strength in A of the current at which a charge at constant voltage ends."""
    return preset.cell.capacity_Ah / TAIL_HOURS


class CcCvController:
    """CC-CV charger of one cell with a cut-back by surface temperature."""

    name = "cc-cv"

    def __init__(self, preset: Preset, cut_back: CutBack | None = None) -> None:
        """Charger for a preset's limits; the cut-back ends at the surface limit by default."""
        limit_K = preset.limits.max_surface_temperature_K
        self._preset = preset
        self._cut_back = cut_back or CutBack(limit_K - CUT_BACK_SPAN_K, limit_K)

    def is_full(self, observation: Observation) -> bool:
        """Whether the current that holds the charging voltage has become small."""
        return bool(
            observation.voltage_V >= charging_voltage_V(self._preset) - REACHED_V
            and -observation.current_A <= tail_current_A(self._preset)
        )

    def decide(self, observation: Observation) -> Decision:
        """Charging current for the next period; 0 A and "invalid" without usable measurements."""
        if not usable(observation):
            return INVALID
        preset = self._preset
        strongest_A = preset.limits.reference_current_A
        wanted_A = min(max(observation.reference_current_A, strongest_A), 0.0)
        allowed_A = {
            "none": wanted_A,
            "voltage": min(current_at_A(preset, observation, charging_voltage_V(preset)), 0.0),
            "surface": wanted_A * self._cut_back.share(observation.surface_temperature_K),
        }
        active = max(allowed_A, key=allowed_A.__getitem__)
        current_A = allowed_A[active]
        return Decision(
            current_A=current_A,
            feasible=True,
            active_constraint=active,
            lower_A=current_A,
            upper_A=0.0,
            margins=NO_MARGINS,
        )
