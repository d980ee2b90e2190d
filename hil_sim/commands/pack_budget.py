"""`bms pack-budget`: what a control period of a pack takes of its CAN bus."""

from __future__ import annotations

import json
from typing import Annotated

import typer
from rich.console import Console

from bms.cli import EXIT_DONE
from bms.commands.options import JsonOption
from bms.text_table import TextTable
from hil_sim.pack.budget import BIT_RATES, budget, most_cells, require_fit


def pack_budget(
    cells: Annotated[int, typer.Option("--cells", min=1, help="Cells in series.")] = 96,
    per_thermistor: Annotated[
        int, typer.Option("--per-thermistor", min=1, help="Cells for each thermistor.")
    ] = 1,
    bit_rate: Annotated[
        int, typer.Option("--bit-rate", min=1, help="Of the bus, in bit/s.")
    ] = 500_000,
    share: Annotated[
        float,
        typer.Option("--share", min=0.01, max=1.0, help="Part of the period that frames may take."),
    ] = 1.0,
    as_json: JsonOption = False,
) -> int:
    """Count frames and bits of a pack's control period, and refuse what its bus cannot carry.

    From the CAN database: every page and message of the fullest period, SYNC and the ECU's answer
    included, each frame as long as stuff bits can make it. Exit code 2, with one line that says
    what would fit, for a period that does not.

    Example: bms pack-budget --cells 96 --bit-rate 500000
    """
    need = budget(cells, -(-cells // per_thermistor))
    require_fit(need, bit_rate, share, per_thermistor)
    rates = sorted({*BIT_RATES, bit_rate})
    most = {rate: most_cells(rate, share, per_thermistor) for rate in rates}
    if as_json:
        content = {
            "cells": need.cells,
            "thermistors": need.thermistors,
            "period_ms": need.period_ms,
            "frames": need.frames,
            "bits": need.bits,
            "load": {str(rate): need.load(rate) for rate in rates},
            "most_cells": {str(rate): count for rate, count in most.items()},
        }
        print(json.dumps(content, indent=2))
        return EXIT_DONE
    table = TextTable(
        "kbit/s", "load %", "cells at most",
        title=f"{cells} cells: {need.frames} frames, {need.bits} bits in {need.period_ms} ms",
    )  # fmt: skip
    for rate in rates:
        load = f"{100.0 * need.load(rate):.1f}"
        table.add_row(f"{rate / 1000:g}", load, str(most[rate]))
    table.print(Console())
    return EXIT_DONE
