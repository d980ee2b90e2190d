"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

DataOption = Annotated[
    Path | None,
    typer.Option(
        "--data",
        help="CSV with the columns time_s, current_A (negative while charging), cooling_power_W, "
        "surface_temperature_K, coolant_temperature_K, core_temperature_K; others are ignored.",
    ),
]
