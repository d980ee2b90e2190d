"""The true cell: integrated in sub-steps of the control period, with its extremes on record."""

from __future__ import annotations

from dataclasses import dataclass

from bms.cell import CellState, integrate_step, terminal_voltage_V
from bms.presets import Preset
from bms.presets.schema import Limits
from hil_sim.plant.disturbances import Source

SUB_STEPS = 10


@dataclass
class Extremes:
    """Largest true values at any sub-step of a run."""

    core_temperature_K: float
    surface_temperature_K: float
    voltage_V: float
    soc: float
    min_anode_potential_V: float | None = None
    """Least, where the plant has electrodes: lithium plates below 0."""

    def violations(self, limits: Limits) -> list[str]:
        """Each limit that was exceeded, by however little, as text with both figures."""
        checks = (
            ("core temperature", self.core_temperature_K, limits.max_core_temperature_K, "K"),
            (
                "surface temperature",
                self.surface_temperature_K,
                limits.max_surface_temperature_K,
                "K",
            ),
            ("voltage", self.voltage_V, limits.max_voltage_V, "V"),
            ("state of charge", self.soc, limits.max_soc, ""),
        )
        return [
            f"{name} {value:.6g} {unit}".rstrip() + f" above {limit:g} {unit}".rstrip()
            for name, value, limit, unit in checks
            if not value <= limit
        ]


class Plant:
    """One cell with its coolant at constant cooling power, driven by a current (A).

    `current_A` (negative while charging) is set from outside and held over a control period; the
    disturbance has a knot at every sub-step.
    """

    def __init__(self, preset: Preset, disturbance: Source) -> None:
        start = preset.initial
        self._cell = preset.cell
        self._step_s = preset.timing.sampling_period_s / SUB_STEPS
        self._source = disturbance
        self._knot = next(disturbance)
        self.cooling_power_W = start.cooling_power_W
        self.current_A = 0.0
        self.state = CellState(
            start.soc, start.temperature_K, start.temperature_K, start.temperature_K
        )
        self.extremes = Extremes(
            start.temperature_K, start.temperature_K, self.voltage_V, start.soc
        )

    @property
    def voltage_V(self) -> float:
        """Terminal voltage in V at the present state and current."""
        return float(terminal_voltage_V(self._cell, self.state.soc, self.current_A))

    def advance(self) -> None:
        """Hold the present current for one control period."""
        current_A = self.current_A
        state, before, extremes = self.state, self._knot, self.extremes
        highest_soc = state.soc
        for _ in range(SUB_STEPS):
            after = next(self._source)
            state = integrate_step(
                self._cell, state, current_A, self.cooling_power_W, self._step_s, before, after
            )
            before = after
            soc, core_K, surface_K, _ = state
            highest_soc = max(highest_soc, soc)
            extremes.core_temperature_K = max(extremes.core_temperature_K, core_K)
            extremes.surface_temperature_K = max(extremes.surface_temperature_K, surface_K)
        self.state, self._knot = state, before
        extremes.soc = max(extremes.soc, highest_soc)
        # At one current the voltage rises with the state of charge, so its peak is there.
        peak_V = float(terminal_voltage_V(self._cell, highest_soc, current_A))
        extremes.voltage_V = max(extremes.voltage_V, peak_V)
