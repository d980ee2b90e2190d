"""What a charge needs of a plant; anything with these attributes can stand there."""

from __future__ import annotations

from typing import Protocol

from bms.cell import CellState
from bms.presets import Preset
from hil_sim.plant.disturbances import Source
from hil_sim.plant.plant import Extremes


class PlantLike(Protocol):
    """A cell with its coolant, driven by a current; SI units, the current negative while charging.

    A charge sets `current_A` once a control period (and `cooling_power_W` when the pump fails),
    reads `voltage_V` and `state`, and calls `advance`. `extremes` is read after the last period.
    """

    current_A: float
    """Current in A, held until it is set anew; 0 at the start."""
    cooling_power_W: float
    """Heat in W that the coolant gives away."""

    @property
    def state(self) -> CellState:
        """True state of charge (-) and core, surface and coolant temperature (K)."""
        ...

    @property
    def voltage_V(self) -> float:
        """Terminal voltage in V at the present state, with the present current."""
        ...

    @property
    def extremes(self) -> Extremes:
        """Largest true values so far; limits are checked against them."""
        ...

    def advance(self) -> None:
        """Hold the present current for one control period of the preset."""


class PlantMaker(Protocol):
    """Makes a plant; entry points of the group `kan_rcbf_bms.plants` are such callables."""

    def __call__(self, argument: str, preset: Preset, disturbance: Source) -> PlantLike:
        """A plant at the initial state of the preset.

        `argument` is what follows the colon of `--plant NAME:ARGUMENT`, empty without one. The
        disturbance has one knot at the start and one after each of plant.SUB_STEPS parts of a
        control period. Raises InputError for an argument that cannot be used.
        """
        ...
