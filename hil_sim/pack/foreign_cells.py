"""Cells of a pack that are plants of their own, in the string of the C plant.

The C plant keeps a stand-in for each of them: the cell that was drawn for its place. It brings the
heat of neighbours and coolant within a control period to the plant, as the plant's disturbance, and
at the end of the period it is set to the plant's state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from bms.cell import CellState, Disturbance
from bms.errors import InputError, PlantError
from bms.presets import Preset
from hil_sim.pack.cell_plants import OPTION, CellPlants
from hil_sim.plant.catalog import make_plant
from hil_sim.plant.seam import PlantLike
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import SUB_STEPS
from hil_sim.studies.pack.spread import PackDraw

_WITHOUT_COUPLING = "fmu"
_REMEDY = "take two-mass, pybamm, recorded, or a plant of your own that uses its disturbance"


class _Knots:
    """The disturbance of a plant, one period at a time."""

    def __init__(self, first: Disturbance) -> None:
        self._waiting = deque([first])

    def __iter__(self) -> _Knots:
        return self

    def __next__(self) -> Disturbance:
        if not self._waiting:
            raise InputError("asks for more knots of its disturbance than there are sub-steps")
        return self._waiting.popleft()

    def supply(self, knots: Sequence[Disturbance]) -> None:
        """Those at the ends of a period's sub-steps."""
        self._waiting.extend(knots)

    @property
    def are_used(self) -> bool:
        """Whether all that was supplied has been taken."""
        return not self._waiting


class ForeignCells:
    """The foreign cells of a pack; all others are the C plant's alone."""

    def __init__(self, preset: Preset, drawn: PackDraw, plants: CellPlants, fields: Any) -> None:
        """Each starts as drawn for its place, with the thermal masses that were drawn.

        `fields` is the C structure of the charge before its first period. Raises InputError for a
        plant that cannot be, or cannot be warmed by others.
        """
        self._plant = ffi.addressof(fields, "plant")
        self._rates = {cell: drawn.disturbances[cell] for cell, _ in plants}
        self._specs = dict(plants)
        first = self._coupling_at_start(drawn, preset.initial.cooling_power_W) if plants else {}
        self._knots: dict[int, _Knots] = {}
        self._plants: dict[int, PlantLike] = {}
        for cell, spec in plants:
            self._knots[cell] = _Knots(self._disturbance(cell, first[cell]))
            start = replace(preset.initial, soc=drawn.states[cell].soc)
            own = replace(preset, cell=drawn.cells[cell], initial=start)
            with self._named(cell):
                self._plants[cell] = _made(spec, own, self._knots[cell])
            self._stand_in(cell)

    @property
    def plants(self) -> dict[int, PlantLike]:
        """By cell, from 0 on."""
        return self._plants

    def voltage_V(self, cell: int) -> float:
        """Terminal voltage with the current that flows in the cell."""
        with self._named(cell):
            return self._plants[cell].voltage_V

    def hold(self, current_A: float) -> None:
        """Hold the pack's current for a control period, in the C plant's cells as well.

        A foreign cell's resistor takes what its voltage at the begin of the period drives.
        """
        for cell, one in self._plants.items():
            with self._named(cell):
                one.current_A = current_A
                if self._plant.cell[cell].bleeds:
                    one.current_A = current_A + one.voltage_V / self._plant.bleed_ohm
        couplings = self._step_stand_ins(current_A)
        for cell, one in self._plants.items():
            knots = [self._disturbance(cell, coupling) for coupling in couplings[cell]]
            self._knots[cell].supply(knots)
            one.cooling_power_W = self._plant.cooling_power_W
            with self._named(cell):
                one.advance()
                if not self._knots[cell].are_used:
                    raise InputError(
                        f"takes no heat from its neighbours and the coolant; {_REMEDY}"
                    )
            self._stand_in(cell)

    def _step_stand_ins(self, current_A: float) -> dict[int, list[tuple[float, float]]]:
        """What others do to each foreign cell at the ends of the sub-steps of a period."""
        seen: dict[int, list[tuple[float, float]]] = {cell: [] for cell in self._plants}
        for _ in range(SUB_STEPS):
            lib.plant_hold(self._plant, current_A, 1)
            for cell, values in seen.items():
                values.append(_coupling(self._plant.cell[cell]))
        for values in seen.values():
            # Each is seen at the begin of its sub-step; the last end goes on as the last sub-step.
            (surface, coolant), (before_surface, before_coolant) = values[-1], values[-2]
            values.append((2.0 * surface - before_surface, 2.0 * coolant - before_coolant))
            del values[0]
        return seen

    def _coupling_at_start(
        self, drawn: PackDraw, cooling_power_W: float
    ) -> dict[int, tuple[float, float]]:
        """The same before the first period, seen on a copy that takes a sub-step."""
        cells = ffi.new("plant_cell_t[]", len(drawn.cells))
        ffi.memmove(cells, self._plant.cell, ffi.sizeof(cells))
        copy = ffi.new("plant_t *")
        ffi.memmove(copy, self._plant, ffi.sizeof("plant_t"))
        copy.cell, copy.cooling_power_W = cells, cooling_power_W
        lib.plant_hold(copy, 0.0, 1)
        return {cell: _coupling(cells[cell]) for cell in self._specs}

    def _disturbance(self, cell: int, coupling: tuple[float, float]) -> Disturbance:
        own, (surface, coolant) = self._rates[cell], coupling
        return own._replace(
            surface_K_per_s=own.surface_K_per_s + surface,
            coolant_K_per_s=own.coolant_K_per_s + coolant,
        )

    def _stand_in(self, cell: int) -> None:
        state: CellState = self._plants[cell].state
        self._plant.cell[cell].memory.state = tuple(map(float, state))

    @contextmanager
    def _named(self, cell: int) -> Iterator[None]:
        """Errors of a cell's plant say which cell it is."""
        try:
            yield
        except (InputError, PlantError) as error:
            text = str(error)
            said = text.removeprefix("--plant ")
            if said == text:
                said = f"{self._specs[cell]}: {text}"
            raise type(error)(f"{OPTION} {cell + 1}={said}") from None


def _made(spec: str, preset: Preset, knots: _Knots) -> PlantLike:
    if spec.partition(":")[0] == _WITHOUT_COUPLING:
        raise InputError(f"a unit takes no heat from its neighbours and the coolant; {_REMEDY}")
    return make_plant(spec, preset, knots)


def _coupling(cell: Any) -> tuple[float, float]:
    """Rates in K/s of surface and coolant that others cause."""
    return cell.coupling.surface, cell.coupling.coolant
