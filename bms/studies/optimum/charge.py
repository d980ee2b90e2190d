"""What is charged: a cell, its start, its limits, and what of its charger the bound counts in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bms.arrays import Array
from bms.cell import CellParameters
from bms.errors import InputError
from bms.presets import Preset
from bms.presets.schema import CurrentMap, Limits


@dataclass(frozen=True)
class Charge:
    """A charge from rest at one temperature to `full_soc`, under limits that always hold.

    `growth_A_per_s` and `current_map` are the charger's and the preset's own; without them it is
    physics alone. A command may step by the growth of a whole period of `period_s` at once.
    """

    cell: CellParameters
    limits: Limits
    start_soc: float
    start_K: float
    cooling_W: float
    growth_A_per_s: float | None = None
    current_map: CurrentMap | None = None
    period_s: float = 0.0

    def __post_init__(self) -> None:
        limits = self.limits
        if not 0.0 <= self.start_soc < limits.completion_soc:
            raise InputError(
                f"state of charge {self.start_soc:g} at the start: must lie from 0 to below "
                f"{limits.completion_soc:g}, where the charge is complete"
            )
        least_K = min(limits.max_core_temperature_K, limits.max_surface_temperature_K)
        if not 200.0 <= self.start_K <= least_K:
            raise InputError(
                f"start at {self.start_K:g} K: must lie from 200 K to the limit of {least_K:g} K"
            )
        if not 0.0 <= self.cooling_W <= 1e4:
            raise InputError(f"cooling of {self.cooling_W:g} W: must lie from 0 to 10000 W")

    @property
    def needed_As(self) -> float:
        """Charge from the start to full in A s."""
        return (self.limits.completion_soc - self.start_soc) * self.cell.capacity_As

    @property
    def strongest_A(self) -> float:
        """Strongest charging current that is allowed at all, as a positive number."""
        return -self.limits.reference_current_A

    @property
    def dynamics(self) -> Array:
        """Matrix (3, 3) in 1/s of core, surface and coolant temperature without heat."""
        cell = self.cell
        core = 1.0 / cell.core_resistance_K_per_W
        surface = 1.0 / cell.surface_resistance_K_per_W
        flow_W_per_K = np.array(
            [[-core, core, 0.0], [core, -core - surface, surface], [0.0, surface, -surface]]
        )
        return flow_W_per_K / self._capacities[:, None]

    @property
    def heating(self) -> Array:
        """Rates (3,) in K/s of the three temperatures by 1 W of heat in the core."""
        return np.array([1.0, 0.0, 0.0]) / self._capacities

    @property
    def cooling(self) -> Array:
        """Rates (3,) in K/s of the three temperatures by the cooling."""
        return np.array([0.0, 0.0, -self.cooling_W]) / self._capacities

    @property
    def _capacities(self) -> Array:
        cell = self.cell
        return np.array(
            [
                cell.core_heat_capacity_J_per_K,
                cell.surface_heat_capacity_J_per_K,
                cell.coolant_heat_capacity_J_per_K,
            ]
        )

    def physics_alone(self) -> Charge:
        """The same charge without ramp and map."""
        return replace(self, growth_A_per_s=None, current_map=None)


def charge_of(
    preset: Preset,
    start_K: float | None = None,
    start_soc: float | None = None,
    cooling_W: float | None = None,
) -> Charge:
    """A preset's nominal cell with its ramp and map, from its own start or from another.

    Raises InputError for a start beyond the limits.
    """
    start = preset.initial
    return Charge(
        cell=preset.cell,
        limits=preset.limits,
        start_soc=start.soc if start_soc is None else start_soc,
        start_K=start.temperature_K if start_K is None else start_K,
        cooling_W=start.cooling_power_W if cooling_W is None else cooling_W,
        growth_A_per_s=preset.limits.current_growth_A_per_s,
        current_map=preset.current_map,
        period_s=preset.timing.sampling_period_s,
    )
