"""What differs from run to run: the cell, its state at plug-in, its cooling, its disturbance."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from bms.arrays import Array
from bms.barrier.rates import heat_range_W
from bms.cell import CellFactors, CellParameters, scaled
from bms.presets import Preset
from bms.presets.schema import Initial
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.plant.true_cell import TrueCell, nominal_cell


class RelativeInterval(NamedTuple):
    """Interval of a parameter relative to its nominal value."""

    low: float
    high: float


CORE_RESISTANCE = RelativeInterval(1.86 / 1.94, 2.01 / 1.94)
CORE_HEAT_CAPACITY = RelativeInterval(59.1 / 62.7, 66.4 / 62.7)
SURFACE_RESISTANCE = RelativeInterval(3.19 / 3.19, 3.20 / 3.19)
"""Confidence intervals of Lin et al. 2014, J. Power Sources 257, Table 1, over its estimates."""

PLUG_IN_SOC = (0.0, 0.5)
COLDEST_ABOVE_BOX_K, HOTTEST_BELOW_LIMIT_K = 2.0, 8.0
"""Start temperatures: the coolant may cool below the start and must stay in the operating box."""

_KINDS = (DisturbanceKind.GAUSSIAN, DisturbanceKind.BANG_BANG, DisturbanceKind.UPWARD)
_SAFETY_FACTOR = 0.9


class Family(str, Enum):
    """How a cell is drawn.

    PUBLISHED: anywhere in the published intervals, with the full disturbance on top. WITHIN: the
    same directions, but shrunk until the parameters take up no more than a random share of the
    uncertainty bounds; the disturbance has the rest.
    """

    WITHIN = "within"
    PUBLISHED = "published"


@dataclass(frozen=True)
class Draw:
    """One cell at plug-in; the disturbance has `disturbance_share` of the preset's bounds."""

    family: Family
    cell: CellParameters
    soc: float
    temperature_K: float
    cooling_power_W: float
    disturbance: DisturbanceKind
    disturbance_share: float

    def true_cell(self, preset: Preset) -> TrueCell:
        """The cell in equilibrium, with the preset's sensors and an ideal charger."""
        start = Initial(self.soc, self.temperature_K, max(self.cooling_power_W, 0.0))
        nominal = nominal_cell(preset, start)
        return replace(nominal, cell=self.cell, cooling_power_W=self.cooling_power_W)


def draw(preset: Preset, run: int, rng: np.random.Generator) -> Draw:
    """Draw of a run; every quantity is uniform in its interval. Families alternate."""
    family = Family.WITHIN if run % 2 == 0 else Family.PUBLISHED
    intervals = (CORE_RESISTANCE, CORE_HEAT_CAPACITY, SURFACE_RESISTANCE)
    factors = np.array([rng.uniform(*interval) for interval in intervals])
    box = preset.operating_box
    soc = rng.uniform(*PLUG_IN_SOC)
    temperature_K = rng.uniform(
        box.surface_temperature_K[0] + COLDEST_ABOVE_BOX_K,
        preset.limits.max_core_temperature_K - HOTTEST_BELOW_LIMIT_K,
    )
    cooling_power_W = rng.uniform(*box.cooling_power_W)
    kind = _KINDS[rng.integers(len(_KINDS))]
    share = rng.uniform()
    if family is Family.WITHIN:
        factors = 1.0 + _shrink(preset, factors, share) * (factors - 1.0)
    return Draw(
        family=family,
        cell=_scaled(preset.cell, factors),
        soc=soc,
        temperature_K=temperature_K,
        cooling_power_W=cooling_power_W,
        disturbance=kind,
        disturbance_share=1.0 - share if family is Family.WITHIN else 1.0,
    )


def _scaled(cell: CellParameters, factors: Array) -> CellParameters:
    core_resistance, core_heat_capacity, surface_resistance = map(float, factors)
    return scaled(
        cell,
        CellFactors(
            core_resistance=core_resistance,
            core_heat_capacity=core_heat_capacity,
            surface_resistance=surface_resistance,
        ),
    )


def _shrink(preset: Preset, factors: Array, share: float) -> float:
    """Factor on the deviations that keeps the error of each rate within a share of its bound.

    Heat flows are bounded by their steady values at the strongest current; a trajectory may exceed
    that by a little, so the classification of a run rests on what it measures, not on this.
    """
    cell, other, bounds = preset.cell, _scaled(preset.cell, factors), preset.uncertainty
    heat_W = heat_range_W(cell, preset).high
    flow_W = max(heat_W, preset.operating_box.cooling_power_W[1])
    core_to_surface_W = abs(1.0 - 1.0 / factors[0]) * heat_W
    surface_to_coolant_W = abs(1.0 - 1.0 / factors[2]) * flow_W
    capacity_J_per_K = other.core_heat_capacity_J_per_K
    core_W = core_to_surface_W + 2.0 * heat_W * abs(factors[1] - 1.0)
    errors_K_per_s = (
        core_W / capacity_J_per_K,
        (core_to_surface_W + surface_to_coolant_W) / cell.surface_heat_capacity_J_per_K,
        surface_to_coolant_W / cell.coolant_heat_capacity_J_per_K,
    )
    allowed = (bounds.core_K_per_s, bounds.surface_K_per_s, bounds.coolant_K_per_s)
    shares = (a / e for a, e in zip(allowed, errors_K_per_s) if e > 0.0)
    return float(min(1.0, _SAFETY_FACTOR * share * min(shares, default=math.inf)))
