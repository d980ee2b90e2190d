"""A cell that nobody derived from the controller's model: porous electrodes by PyBaMM."""

from __future__ import annotations

from bms.cell import CellState, EntropyTable
from bms.errors import InputError
from bms.presets import Preset
from hil_sim.plant.arguments import Range, split_argument
from hil_sim.plant.disturbances import Source
from hil_sim.plant.electrochemistry import (
    MODELS,
    REFERENCE_TEMPERATURE_K,
    Electrochemistry,
    Outputs,
)
from hil_sim.plant.heated_masses import HeatedMasses
from hil_sim.plant.plant import Extremes

MEASURED_ENTROPY = EntropyTable(
    soc=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),
    V_per_K=(
        -3.64e-4, -4.65e-4, -1.66e-4, -1.05e-4, -5.1e-5, 7.6e-5, 1.08e-4, 1.24e-4, 1.2e-5, 4.0e-5,
        2.24e-4,
    ),
)  # fmt: skip
"""dU/dT of the A123 26650, measured; source: A. Kawakita de Souza, UCCS, A123_26650_MPCcharging."""

_OPTIONS = {"contact": Range(0.0, 0.1, "ohm")}


def make(argument: str, preset: Preset, disturbance: Source) -> PybammPlant:
    """The plant of `pybamm[:MODEL[,contact=OHM]]`; InputError for another argument."""
    model, options = split_argument("pybamm", argument or "spme", _OPTIONS)
    if model not in MODELS:
        raise InputError(
            f"--plant pybamm:{argument}: no model '{model}'; take one of {', '.join(MODELS)}"
        )
    cell = Electrochemistry(
        model,
        preset.initial.soc,
        preset.initial.temperature_K,
        preset.timing.sampling_period_s,
    )
    return PybammPlant(preset, disturbance, cell, options.get("contact", 0.0))


class PybammPlant:
    """Electrochemistry at core temperature; its heat warms the two masses of the preset.

    To the set, whose potentials do not depend on temperature, come a contact resistance and the
    cell's measured dU/dT, each with its voltage and its heat.
    """

    def __init__(
        self,
        preset: Preset,
        disturbance: Source,
        cell: Electrochemistry,
        contact_ohm: float = 0.0,
        entropy: EntropyTable = MEASURED_ENTROPY,
    ) -> None:
        self._cell, self._contact_ohm, self._entropy = cell, contact_ohm, entropy
        self._masses = HeatedMasses(preset, disturbance)
        self.cooling_power_W = preset.initial.cooling_power_W
        self.current_A = 0.0
        self._solved: tuple[float, Outputs, Outputs] | None = None
        """A step from the present state: its current, its begin and its end."""
        self._reached: tuple[float, float] | None = None
        """Current and voltage (A, V) at the end of the last period."""
        at_rest, _ = self._step()
        state = self.state
        self.extremes = Extremes(
            state.core_temperature_K,
            state.surface_temperature_K,
            self.voltage_V,
            state.soc,
            at_rest.anode_potential_V,
        )

    @property
    def state(self) -> CellState:
        """True state of charge (-) of the set, and core, surface and coolant temperature (K)."""
        return self._masses.state

    @property
    def voltage_V(self) -> float:
        """Terminal voltage in V at the present state, with the present current."""
        if self._reached is not None and self._reached[0] == self.current_A:
            return self._reached[1]
        return self._terminal_V(self._step()[0])

    def advance(self) -> None:
        """Hold the present current for one control period."""
        begin, end = self._step()
        before_V, after_V = self._terminal_V(begin), self._terminal_V(end)
        peaks, current_A = self.extremes, self.current_A
        core_K = self.state.core_temperature_K
        entropic_V_per_K = float(self._entropy(0.5 * (begin.soc + end.soc)))
        heat_W = (
            0.5 * (begin.heat_W + end.heat_W)
            + self._contact_ohm * current_A**2
            - current_A * core_K * entropic_V_per_K
        )
        self._masses.advance(heat_W, end.soc, self.cooling_power_W, peaks)
        self._cell.keep()
        self._solved, self._reached = None, (current_A, after_V)
        peaks.voltage_V = max(peaks.voltage_V, before_V, after_V)
        peaks.soc = max(peaks.soc, end.soc)
        assert peaks.min_anode_potential_V is not None
        peaks.min_anode_potential_V = min(
            peaks.min_anode_potential_V, begin.anode_potential_V, end.anode_potential_V
        )

    def _step(self) -> tuple[Outputs, Outputs]:
        """Begin and end of a period with the present current, solved once."""
        if self._solved is None or self._solved[0] != self.current_A:
            outputs = self._cell.step(self.current_A, self.state.core_temperature_K)
            self._solved = (self.current_A, *outputs)
        return self._solved[1:]

    def _terminal_V(self, outputs: Outputs) -> float:
        above_K = self.state.core_temperature_K - REFERENCE_TEMPERATURE_K
        entropic_V: float = float(self._entropy(outputs.soc)) * above_K
        return outputs.voltage_V - self.current_A * self._contact_ohm + entropic_V
