"""How the cells of a pack differ from the preset's, and how heat gets from one to the next."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from bms.cell import CellFactors, CellParameters, CellState, Disturbance, at_rest_V, scaled
from bms.presets import Preset

Interval = tuple[float, float]


@dataclass(frozen=True)
class Spread:
    """Intervals of the factors on a cell's parameters, and half the range of its start.

    The defaults are an ordinary spread: core as published (Lin et al. 2014, J. Power Sources 257,
    Table 1), the rest chosen.
    """

    core_resistance: Interval = (1.86 / 1.94, 2.01 / 1.94)
    core_heat_capacity: Interval = (59.1 / 62.7, 66.4 / 62.7)
    surface_resistance: Interval = (0.97, 1.03)
    resistance: Interval = (0.95, 1.05)
    capacity: Interval = (0.98, 1.02)
    start_soc: float = 0.01

    def factors(self, rng: np.random.Generator) -> CellFactors:
        """Factors of one cell, each uniform in its interval."""
        intervals = asdict(self)
        del intervals["start_soc"]
        return CellFactors(**{name: float(rng.uniform(*ends)) for name, ends in intervals.items()})

    def corners(self, cell: CellParameters) -> list[CellParameters]:
        """Cells at all ends of the thermal parameters at once."""
        return [
            scaled(
                cell,
                CellFactors(core_resistance=rc, core_heat_capacity=cc, surface_resistance=rs),
            )
            for rc in self.core_resistance
            for cc in self.core_heat_capacity
            for rs in self.surface_resistance
        ]


@dataclass(frozen=True)
class Surroundings:
    """What cells share: conduction between two neighbours' surfaces, and the coolant's flow.

    0.02 W/K is an air gap of 2 mm between cylindrical cells, 50 W/K about 0.7 litres of water a
    minute.
    """

    neighbour_W_per_K: float = 0.02
    flow_W_per_K: float = 50.0


@dataclass(frozen=True)
class PackDraw:
    """The cells of one pack: parameters, state at plug-in and a constant disturbance of each."""

    cells: tuple[CellParameters, ...]
    states: tuple[CellState, ...]
    disturbances: tuple[Disturbance, ...]


def family_factors(preset: Preset, rng: np.random.Generator) -> CellFactors:
    """Factors of a cell of the family that a preset states, each uniform in its interval."""
    interval = preset.cell.interval
    assert interval is not None
    ends = {field.name: getattr(interval, field.name) for field in fields(interval)}
    del ends["longest_relaxation_s"]
    pairs = {
        name: value if isinstance(value, tuple) else (-value, value) for name, value in ends.items()
    }
    return CellFactors(**{name: float(rng.uniform(*pair)) for name, pair in pairs.items()})


def draw_pack(
    preset: Preset, spread: Spread, cells: int, rng: np.random.Generator, disturbed: bool = True
) -> PackDraw:
    """A pack in equilibrium at the preset's start; states of charge stay between 0 and 1.

    Of a preset that states a family the cells are anywhere in that, otherwise in the spread. Each
    cell's disturbance is uniform within the preset's bounds at 0 A.
    """
    start, bounds = preset.initial, preset.uncertainty
    widest = np.array(
        [bounds.soc_per_s, bounds.core_K_per_s, bounds.surface_K_per_s, bounds.coolant_K_per_s]
    )
    drawn, states, disturbances = [], [], []
    for _ in range(cells):
        is_family = preset.cell.interval is not None
        factors = family_factors(preset, rng) if is_family else spread.factors(rng)
        drawn.append(scaled(preset.cell, factors))
        soc = start.soc + float(rng.uniform(-spread.start_soc, spread.start_soc))
        states.append(CellState(min(max(soc, 0.0), 1.0), *[start.temperature_K] * 3))
        rates = widest * rng.uniform(-1.0, 1.0, 4) * (1.0 if disturbed else 0.0)
        disturbances.append(Disturbance(*map(float, rates)))
    return PackDraw(tuple(drawn), tuple(states), tuple(disturbances))


def memory_fields(cell: CellParameters, state: CellState) -> dict[str, Any]:
    """Initialiser of the C plant's memory of a cell at rest."""
    return {"state": tuple(state), "polarisation_V": at_rest_V(cell)}
