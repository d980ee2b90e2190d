"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bms.presets import DEFAULT_PRESET
from hil_sim.plant.disturbances import DisturbanceKind

PresetOption = Annotated[
    str, typer.Option("--preset", help="Name of a shipped preset, or path of a TOML file.")
]
ModelOption = Annotated[
    Path | None,
    typer.Option("--model", help="JSON model of the estimator. Default: the preset's own."),
]
BusOption = Annotated[
    str,
    typer.Option(
        "--bus",
        help="CAN bus as interface:channel in python-can's terms, e.g. virtual:bms, "
        "socketcan:vcan0.",
    ),
]
SeedOption = Annotated[
    int, typer.Option("--seed", min=0, help="Seed of sensor noise and disturbance.")
]
DisturbanceOption = Annotated[
    DisturbanceKind,
    typer.Option(
        "--disturbance",
        help="Additions to the cell's rates (K/s, 1/s) within the preset's bounds; "
        "upward heats all the time.",
    ),
]
OutOption = Annotated[
    Path | None,
    typer.Option(
        "--out",
        help="Folder for summary.json, report.html, charge.png and can.log. "
        "Default: nothing is written.",
    ),
]
LogOption = Annotated[
    Path | None,
    typer.Option(
        "--log",
        help="Record the bus to this file too: .log, .asc, .csv (also .gz), .blf or .mf4. "
        "Default: nothing but can.log in --out.",
    ),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the summary as JSON and nothing else.")
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
MaxTimeOption = Annotated[
    float,
    typer.Option("--max-time-s", min=0.1, help="End of the run in s after the charge began."),
]

__all__ = [
    "DEFAULT_PRESET",
    "BusOption",
    "DisturbanceOption",
    "FaultsOption",
    "JsonOption",
    "LogOption",
    "MaxTimeOption",
    "ModelOption",
    "OutOption",
    "PresetOption",
    "RealtimeOption",
    "SeedOption",
]
