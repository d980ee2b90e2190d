"""The true cell: integrated in sub-steps of the control period, with its extremes on record."""

from __future__ import annotations

from dataclasses import dataclass

from bms.cell import Disturbance, integrate_step, polarisation_after_V, terminal_voltage_V
from bms.presets import Preset
from bms.presets.schema import Limits
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
    disturbance has a knot at every sub-step.
    """

    def __init__(
        self, preset: Preset, disturbance: Source, true_cell: TrueCell | None = None
    ) -> None:
        """The preset's own cell at its start, or another one."""
        true_cell = true_cell or nominal_cell(preset)
        self._cell = true_cell.cell
        self._bounds = preset.uncertainty
        self._reference_A = preset.limits.reference_current_A
        self._step_s = preset.timing.sampling_period_s / SUB_STEPS
        self._source = disturbance
        self._knot = next(disturbance)
        self._full_cooling_W = true_cell.cooling_power_W
        self._coolant_floor_K = true_cell.coolant_floor_K
        self.current_A = 0.0
        self.state = true_cell.state
        self.polarisation_V = true_cell.polarisation_V
        self.extremes = Extremes(
            self.state.core_temperature_K,
            self.state.surface_temperature_K,
            self.voltage_V,
            self.state.soc,
        )

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
        return float(
            terminal_voltage_V(
                self._cell,
                self.state.soc,
                self.current_A,
                self.state.core_temperature_K,
                self.polarisation_V,
            )
        )

    def advance(self) -> None:
        """Hold the present current for one control period."""
        current_A, cell, extremes = self.current_A, self._cell, self.extremes
        step_s, cooling_W = self._step_s, self.cooling_power_W
        growth = core_growth(self._bounds, current_A, self._reference_A)
        is_plain = cell.resistance is None and not cell.branches
        before = _grown(self._knot, growth)
        highest_soc = self.state.soc
        if not is_plain:
            extremes.voltage_V = max(extremes.voltage_V, self.voltage_V)
        for _ in range(SUB_STEPS):
            self._knot = next(self._source)
            after = _grown(self._knot, growth)
            volts = self.polarisation_V
            self.state = integrate_step(
                cell, self.state, current_A, cooling_W, step_s, before, after, volts
            )
            before = after
            soc, core_K, surface_K, _ = self.state
            highest_soc = max(highest_soc, soc)
            extremes.core_temperature_K = max(extremes.core_temperature_K, core_K)
            extremes.surface_temperature_K = max(extremes.surface_temperature_K, surface_K)
            if not is_plain:
                self.polarisation_V = polarisation_after_V(cell, volts, current_A, step_s)
                extremes.voltage_V = max(extremes.voltage_V, self.voltage_V)
        extremes.soc = max(extremes.soc, highest_soc)
        if is_plain:
            # At one current the voltage rises with the state of charge, so its peak is there.
            peak_V = float(terminal_voltage_V(cell, highest_soc, current_A))
            extremes.voltage_V = max(extremes.voltage_V, peak_V)


def _grown(knot: Disturbance, growth: float) -> Disturbance:
    """A knot of a source, whose core is that of the reference current, at another current."""
    if growth == 1.0:
        return knot
    return knot._replace(core_K_per_s=knot.core_K_per_s * growth)
