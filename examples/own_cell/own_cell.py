"""A plant of one's own inside `bms sil`: one thermal mass, a resistance and one RC branch.

    pip install --no-deps examples/own_cell
    bms sil --preset lin2014 --plant own-cell:0.009

A class around an FMU looks the same: `advance` calls its doStep.
"""

from __future__ import annotations

from bms.cell import CellState
from bms.errors import InputError
from bms.presets import Preset
from hil_sim.plant.disturbances import Source
from hil_sim.plant.plant import Extremes

BRANCH_OHM, BRANCH_S = 0.004, 20.0


def make(argument: str, preset: Preset, disturbance: Source) -> OwnCell:
    """The plant of `own-cell:OHM`; the disturbance is not used."""
    try:
        return OwnCell(float(argument), preset)
    except ValueError:
        raise InputError(
            f"--plant own-cell:{argument}: give the resistance in ohm, such as own-cell:0.009"
        ) from None


class OwnCell:
    """The cell that a charge drives; SI units, the current negative while charging."""

    def __init__(self, resistance_ohm: float, preset: Preset) -> None:
        start = preset.initial
        self._resistance_ohm, self._preset = resistance_ohm, preset
        self._polarisation_V = 0.0
        self.current_A = 0.0
        self.cooling_power_W = start.cooling_power_W
        self.state = CellState(start.soc, *3 * [start.temperature_K])
        self.extremes = Extremes(*2 * [start.temperature_K], self.voltage_V, start.soc)

    @property
    def voltage_V(self) -> float:
        drop_V = self.current_A * self._resistance_ohm + self._polarisation_V
        return 3.25 + 0.1 * self.state.soc - drop_V

    def advance(self) -> None:
        """One control period, by an explicit step."""
        step_s, cell, before_V = (
            self._preset.timing.sampling_period_s,
            self._preset.cell,
            self.voltage_V,
        )
        soc, core_K, _, coolant_K = self.state
        heat_W = self.current_A * (self.current_A * self._resistance_ohm + self._polarisation_V)
        passed_on_W = (core_K - coolant_K) / cell.surface_resistance_K_per_W
        core_K += (heat_W - passed_on_W) * step_s / cell.core_heat_capacity_J_per_K
        coolant_K += (
            (passed_on_W - self.cooling_power_W) * step_s / cell.coolant_heat_capacity_J_per_K
        )
        wanted_V = self.current_A * BRANCH_OHM
        self._polarisation_V += (wanted_V - self._polarisation_V) * step_s / BRANCH_S
        soc -= self.current_A * step_s / cell.capacity_As
        self.state = CellState(soc, core_K, core_K, coolant_K)
        self.extremes.core_temperature_K = max(self.extremes.core_temperature_K, core_K)
        self.extremes.surface_temperature_K = max(self.extremes.surface_temperature_K, core_K)
        self.extremes.voltage_V = max(self.extremes.voltage_V, before_V, self.voltage_V)
        self.extremes.soc = max(self.extremes.soc, soc)
