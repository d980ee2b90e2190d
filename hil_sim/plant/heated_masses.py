"""Core, surface and coolant of a preset, heated by what another model of the cell gives off."""

from __future__ import annotations

from bms.cell import CellState, Disturbance, integrate_step
from bms.presets import Preset
from hil_sim.plant.disturbances import Source
from hil_sim.plant.plant import SUB_STEPS, Extremes


class HeatedMasses:
    """The thermal half of the cell model: heat comes from outside, no current flows in it.

    `state` keeps a state of charge that its owner sets. The disturbance acts on the three
    temperatures; its rate of charge belongs to the owner and is not used.
    """

    def __init__(self, preset: Preset, disturbance: Source) -> None:
        start = preset.initial
        self._cell = preset.cell
        self._step_s = preset.timing.sampling_period_s / SUB_STEPS
        self._source = disturbance
        self._knot = next(disturbance)
        self.state = CellState(
            start.soc, start.temperature_K, start.temperature_K, start.temperature_K
        )

    def advance(
        self, heat_W: float, soc_after: float, cooling_power_W: float, extremes: Extremes
    ) -> None:
        """One control period of constant heat (W) into the core; the peaks go into `extremes`."""
        extremes.add_heat(heat_W, SUB_STEPS * self._step_s)
        state = self.state._replace(soc=soc_after)
        heating_K_per_s = heat_W / self._cell.core_heat_capacity_J_per_K
        before = self._heated(self._knot, heating_K_per_s)
        for _ in range(SUB_STEPS):
            self._knot = next(self._source)
            after = self._heated(self._knot, heating_K_per_s)
            state = integrate_step(
                self._cell, state, 0.0, cooling_power_W, self._step_s, before, after
            )
            before = after
            extremes.core_temperature_K = max(extremes.core_temperature_K, state.core_temperature_K)
            extremes.surface_temperature_K = max(
                extremes.surface_temperature_K, state.surface_temperature_K
            )
        self.state = state

    @staticmethod
    def _heated(knot: Disturbance, heating_K_per_s: float) -> Disturbance:
        return knot._replace(soc_per_s=0.0, core_K_per_s=knot.core_K_per_s + heating_K_per_s)
