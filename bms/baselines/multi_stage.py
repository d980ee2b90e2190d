"""Multi-stage constant current: the current falls in steps, each for good.

A stage ends when the cell has reached its state of charge, its surface temperature, or the charging
voltage at the stage's current; the charge never goes back to an earlier one. After the last stage
the current is 0 A. The five stages fall evenly from the reference current; their ends are this
project's choice of a profile that spares a cell which is nearly full or warm, not a published one.
"""

from __future__ import annotations

from dataclasses import dataclass

from bms.baselines.measured_cell import charging_voltage_V, usable, voltage_at_V
from bms.decision import INVALID, NO_MARGINS, Decision, Observation
from bms.presets import Preset


@dataclass(frozen=True)
class Stage:
    """Share of the reference current, and the ends: state of charge, and kelvin below the limit."""

    current_share: float
    end_soc: float
    end_below_limit_K: float


STAGES = (
    Stage(current_share=1.0, end_soc=0.40, end_below_limit_K=10.0),
    Stage(current_share=0.8, end_soc=0.60, end_below_limit_K=7.0),
    Stage(current_share=0.6, end_soc=0.75, end_below_limit_K=5.0),
    Stage(current_share=0.4, end_soc=0.90, end_below_limit_K=3.0),
    Stage(current_share=0.2, end_soc=1.00, end_below_limit_K=0.0),
)


class MultiStageController:
    """Multi-stage charger of one cell; an object charges once."""

    name = "multi-stage"

    def __init__(self, preset: Preset, stages: tuple[Stage, ...] = STAGES) -> None:
        """Charger for a preset's limits, at the first stage."""
        self._preset = preset
        self._stages = stages
        self._stage = 0
        self._ended_by = "none"

    def decide(self, observation: Observation) -> Decision:
        """Charging current for the next period; 0 A and "invalid" without usable measurements.

        The active constraint is what ended the last stage.
        """
        if not usable(observation):
            return INVALID
        wanted_A = min(
            max(observation.reference_current_A, self._preset.limits.reference_current_A), 0.0
        )
        while (end := self._end_of_stage(observation, wanted_A)) is not None:
            self._ended_by = end
            self._stage += 1
        is_over = self._stage == len(self._stages)
        current_A = 0.0 if is_over else wanted_A * self._stages[self._stage].current_share
        return Decision(
            current_A=current_A,
            feasible=True,
            active_constraint=self._ended_by,
            lower_A=current_A,
            upper_A=0.0,
            margins=NO_MARGINS,
        )

    def _end_of_stage(self, observation: Observation, wanted_A: float) -> str | None:
        """What ends the present stage now, None when it goes on or there is none left."""
        if self._stage == len(self._stages):
            return None
        stage, preset = self._stages[self._stage], self._preset
        limit_K = preset.limits.max_surface_temperature_K
        current_A = wanted_A * stage.current_share
        if observation.soc >= stage.end_soc:
            return "soc"
        if observation.surface_temperature_K >= limit_K - stage.end_below_limit_K:
            return "surface"
        if voltage_at_V(preset, observation, current_A) >= charging_voltage_V(preset):
            return "voltage"
        return None
