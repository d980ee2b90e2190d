"""Options that several commands of the simulator share; bms.commands.options has the others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bms.commands.options import out_folder_option, processes_option, seed_option
from hil_sim.plant.disturbances import DisturbanceKind

_BUS_FORM = "CAN bus as interface:channel in python-can's terms, e.g."

BusOption = Annotated[str, typer.Option("--bus", help=f"{_BUS_FORM} virtual:bms, socketcan:vcan0.")]
SharedBusOption = Annotated[str, typer.Option("--bus", help=f"{_BUS_FORM} socketcan:vcan0.")]
SeedOption = Annotated[int, seed_option("sensor noise and disturbance")]
DisturbanceOption = Annotated[
    DisturbanceKind,
    typer.Option(
        "--disturbance",
        help="Additions to the cell's rates (K/s, 1/s) within the preset's bounds; "
        "upward heats all the time.",
    ),
]
OutOption = Annotated[
    Path | None, out_folder_option("summary.json, report.html, charge.png and can.log")
]
LogOption = Annotated[
    Path | None,
    typer.Option(
        "--log",
        help="Record the bus to this file too: .log, .asc, .csv, .trc (also .gz), .blf or .mf4. "
        "Default: nothing but can.log in --out.",
    ),
]
ChannelOption = Annotated[
    str | None,
    typer.Option(
        "--channel",
        help="Channel of a log that holds frames of several, by the name that it has there.",
    ),
]
DeltaTimesOption = Annotated[
    bool,
    typer.Option(
        "--delta-times",
        help="Each time of a log counts from the line before, as with 'candump -t d'.",
    ),
]
RealtimeOption = Annotated[
    bool, typer.Option("--realtime", help="Run on the wall clock instead of virtual time.")
]
FaultsOption = Annotated[
    Path | None,
    typer.Option(
        "--faults", help="TOML file of faults to inject, see docs/faults.md. Default: none."
    ),
]
PlantOption = Annotated[
    str,
    typer.Option(
        "--plant",
        help="The cell: two-mass, pybamm:spme or pybamm:dfn (also ,contact=OHM), recorded:CSV "
        "(also ,soc=START), fmu:FILE (also ,NAME=ITS_NAME), or one of one's own; docs/plants.md.",
    ),
]
MaxTimeOption = Annotated[
    float,
    typer.Option("--max-time-s", min=0.1, help="End of the run in s after the charge began."),
]
JobsOption = Annotated[int, processes_option("--jobs")]
RowsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--rows",
        help="Rows of the fault matrix whose name contains this; * and ? stand for others. "
        "May be repeated. Default: all.",
    ),
]
