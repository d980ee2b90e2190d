"""Which cells of a pack are another plant than the pack's own, as an option names them."""

from __future__ import annotations

from collections.abc import Sequence

from bms.errors import InputError

OPTION = "--cell-plant"

CellPlants = tuple[tuple[int, str], ...]
"""Cell, from 0 on, and its plant as `--plant` names it; in the order of the cells."""


def cell_plants(named: Sequence[str], cells: int) -> CellPlants:
    """What `CELL=PLANT` says, once for each option; cells count from 1 there.

    Raises InputError in one line for what is no such text and for a cell that a pack of so many
    cells does not have, or that is named twice.
    """
    plants: dict[int, str] = {}
    for text in named:
        number, _, plant = text.partition("=")
        where = f"{OPTION} {text}"
        if not (number.isdecimal() and plant):
            raise InputError(f"{where}: write the cell's number and its plant, such as 3=pybamm")
        cell = int(number)
        if not 1 <= cell <= cells:
            raise InputError(f"{where}: cell {cell}: the pack has cells 1 to {cells}; name those")
        if cell - 1 in plants:
            raise InputError(f"{where}: cell {cell} is named twice; a cell is one plant")
        plants[cell - 1] = plant
    return tuple(sorted(plants.items()))
