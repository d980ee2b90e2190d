"""The true cell: integrated in sub-steps of the control period, with its extremes on record."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice

from bms.cell import CellState, Polarisation
from bms.presets import Preset
from bms.presets.schema import Limits
from hil_sim.native._native import ffi, lib
from hil_sim.native.cell_fields import cell_fields
from hil_sim.plant.disturbances import Source, core_growth
from hil_sim.plant.true_cell import TrueCell, cooling_share, nominal_cell

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
    heat_J: float | None = None
    """Not an extreme: heat that the cell has produced so far, where the plant knows it."""

    def add_heat(self, heat_W: float, duration_s: float) -> None:
        """A constant heat flow in W has lasted for some time."""
        self.heat_J = (self.heat_J or 0.0) + heat_W * duration_s

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
    """One cell with its coolant and its cooling power, driven by a current (A).

    `current_A` (negative while charging) is set from outside and held over a control period; the
    disturbance has a knot at every sub-step. The cell is the one of the campaigns, in C.
    """

    def __init__(
        self, preset: Preset, disturbance: Source, true_cell: TrueCell | None = None
    ) -> None:
        """The preset's own cell at its start, or another one; InputError as cell_fields."""
        true_cell = true_cell or nominal_cell(preset)
        self._bounds = preset.uncertainty
        self._reference_A = preset.limits.reference_current_A
        step_s = preset.timing.sampling_period_s / SUB_STEPS
        self._period_s = preset.timing.sampling_period_s
        self._heat_J = 0.0
        self._cell = ffi.new("cell_t *", cell_fields(true_cell.cell, step_s))
        self._memory = ffi.new(
            "cell_memory_t *",
            {"state": tuple(true_cell.state), "polarisation_V": true_cell.polarisation_V},
        )
        self._source = disturbance
        self._knot = ffi.new("cell_state_t *", tuple(map(float, next(disturbance))))
        self._knots = ffi.new("double[]", SUB_STEPS * lib.CELL_KNOT_WIDTH)
        self._peaks = ffi.new("cell_peaks_t *")
        self._full_cooling_W = true_cell.cooling_power_W
        self._coolant_floor_K = true_cell.coolant_floor_K
        self.current_A = 0.0
        self.state = self._state_now()
        """True state, as it was when the last period ended."""
        peaks = self._peaks
        peaks.soc, peaks.voltage_V = self.state.soc, self.voltage_V
        peaks.core_temperature_K = self.state.core_temperature_K
        peaks.surface_temperature_K = self.state.surface_temperature_K

    @property
    def extremes(self) -> Extremes:
        """Largest true values at any sub-step so far."""
        peaks = self._peaks
        return Extremes(
            peaks.core_temperature_K,
            peaks.surface_temperature_K,
            peaks.voltage_V,
            peaks.soc,
            heat_J=self._heat_J,
        )

    @property
    def polarisation_V(self) -> Polarisation:
        """Voltage of each branch in V."""
        return tuple(self._memory.polarisation_V)[: self._cell.branches]

    @property
    def cooling_power_W(self) -> float:
        """Cooling power in W of this control period; what is set is the cooler's full power."""
        share = cooling_share(self.state.coolant_temperature_K, self._coolant_floor_K)
        return self._full_cooling_W * share

    @cooling_power_W.setter
    def cooling_power_W(self, full_W: float) -> None:
        self._full_cooling_W = full_W

    @property
    def voltage_V(self) -> float:
        """Terminal voltage in V at the present state and current."""
        volts: float = lib.cell_terminal_voltage_V(self._cell, self._memory, self.current_A)
        return volts

    def advance(self) -> None:
        """Hold the present current for one control period."""
        current_A = self.current_A
        self._knots[0 : len(self._knots)] = [
            value for knot in islice(self._source, SUB_STEPS) for value in knot
        ]
        memory = self._memory
        heat_W = lib.cell_heat_W(self._cell, ffi.addressof(memory.state), current_A)
        heat_W += lib.cell_polarisation_heat_W(self._cell, memory.polarisation_V)
        self._heat_J += heat_W * self._period_s
        lib.cell_hold(
            self._cell,
            self._memory,
            current_A,
            self.cooling_power_W,
            core_growth(self._bounds, current_A, self._reference_A),
            self._knot,
            self._knots,
            SUB_STEPS,
            self._peaks,
            ffi.NULL,
            ffi.NULL,
        )
        self.state = self._state_now()

    def _state_now(self) -> CellState:
        state = self._memory.state
        return CellState(state.soc, state.core, state.surface, state.coolant)
