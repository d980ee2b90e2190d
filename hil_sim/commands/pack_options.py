"""The options of `bms sil`, `bms plant` and `bms ecu` that mean a pack in place of one cell.

What runs a pack is loaded only for one: a single cell's ECU starts without plots and solvers.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from bms.errors import InputError
from hil_sim.pack.spread_kind import SpreadKind

CellsOption = Annotated[
    int | None,
    typer.Option("--cells", min=1, help="A pack of so many cells in series. Default: one cell."),
]
SpreadOption = Annotated[
    SpreadKind, typer.Option("--spread", help="How the cells of a pack differ; with --cells.")
]
PerThermistorOption = Annotated[
    int,
    typer.Option("--per-thermistor", min=1, help="Cells for each thermistor; with --cells."),
]
ThermistorsOption = Annotated[
    Path | None,
    typer.Option(
        "--thermistors",
        help="TOML file with the cell that each thermistor is at, in place of --per-thermistor: "
        "[pack], thermistor_at = [3, 8, 14].",
    ),
]
NeighbourOption = Annotated[
    float,
    typer.Option(
        "--neighbour-w-per-k",
        min=0.0,
        help="Heat conduction between the surfaces of two neighbours of a pack.",
    ),
]
FlowOption = Annotated[
    float,
    typer.Option(
        "--flow-w-per-k",
        min=0.1,
        help="Heat capacity of the coolant that passes in a second; it warms along the string.",
    ),
]

CellPlantOption = Annotated[
    list[str] | None,
    typer.Option(
        "--cell-plant",
        help="One cell of a pack, from 1 on, as another plant: CELL=PLANT with what --plant takes, "
        "such as 3=pybamm; fmu excepted. May be repeated; with --cells.",
    ),
]
BleedOption = Annotated[
    float,
    typer.Option(
        "--bleed-ohm",
        min=0.0,
        help="Balancing resistor across each cell, 0 for none; with --cells.",
    ),
]
BalanceOption = Annotated[
    float,
    typer.Option(
        "--balance-s", min=0.0, help="Time for which a full pack stays plugged in; with --cells."
    ),
]


def refuse_options(given: Mapping[str, bool]) -> None:
    """Raise InputError for the first option that is given and means one cell only."""
    for option, is_given in given.items():
        if is_given:
            instead = ", or give --cell-plant" if option == "--plant" else ""
            raise InputError(f"{option}: is for one cell; leave it out, or --cells{instead}")


def refuse_pack_options(
    spread: SpreadKind,
    per_thermistor: int,
    thermistors: Path | None = None,
    cell_plant: list[str] | None = None,
) -> None:
    """Raise InputError for an option that means a pack, without --cells."""
    is_given = spread is not SpreadKind.PUBLISHED or per_thermistor != 1
    refuse_without_cells("--spread, --per-thermistor", is_given)
    refuse_without_cells("--thermistors", thermistors is not None)
    refuse_without_cells("--cell-plant", bool(cell_plant))


def refuse_balancing(bleed_ohm: float, balance_s: float = 0.0) -> None:
    """Raise InputError for balancing without --cells."""
    refuse_without_cells("--bleed-ohm, --balance-s", bleed_ohm != 0.0 or balance_s != 0.0)


def refuse_without_cells(options: str, is_given: bool) -> None:
    """Raise InputError where one of these options is given."""
    if is_given:
        raise InputError(f"{options}: are for a pack; add --cells")
