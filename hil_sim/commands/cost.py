"""`bms cost`: what the firmware's work costs on an emulated microcontroller."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from bms.errors import InputError
from bms.presets import DEFAULT_PRESET, load_preset
from hil_sim.cost import CostReport, measure_cost
from hil_sim.cost.chart import write_chart

WITHIN, BEYOND = 0, 1
_PREFIX = "qemu:"
_BUILDS = Path("build/firmware")


def cost(
    target: Annotated[
        list[str], typer.Option("--target", help="Board, as qemu:NAME; any number of times.")
    ] = ["qemu:mps2-an386", "qemu:mps2-an385"],  # noqa: B006
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of noise and search.")] = 0,
    charges: Annotated[
        int, typer.Option("--charges", min=1, help="Random beginnings of charges in the search.")
    ] = 100,
    states: Annotated[
        int, typer.Option("--states", min=50, help="States in a generation of the search.")
    ] = 5000,
    limit: Annotated[
        int | None,
        typer.Option(
            "--limit", min=1, help="Instructions that estimate and decision may cost together."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="PNG with the instructions over the charge.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON only.")] = False,
) -> int:
    """Count instructions of estimate, decision and control period over a charge and a search.

    The compiled-in tables run on a board in QEMU, whose time advances by the same step with every
    instruction. These are instructions, not clock cycles: memory has no wait states, and a division
    or a square root counts one. `make cost` builds the programs. Exit code 1 beyond --limit.

    Example: bms cost --target qemu:mps2-an386 --limit 1500 --out cost.png
    """
    preset = load_preset(DEFAULT_PRESET)
    boards = [_board(name) for name in target]
    reports = [
        measure_cost(
            _BUILDS / board.replace("-", "_") / "cost.elf", board, preset, seed, charges, states
        )
        for board in boards
    ]
    if out is not None:
        write_chart(reports, preset.timing.sampling_period_s, out)
    if as_json:
        typer.echo(json.dumps([report.to_json() for report in reports], indent=1))
    else:
        _print(reports, charges, states)
    worst = max(report.costs["estimate_and_decision"].worst for report in reports)
    if limit is not None and worst > limit:
        typer.echo(f"estimate and decision: {worst} instructions, allowed {limit}", err=True)
        return BEYOND
    return WITHIN


def _board(target: str) -> str:
    if not target.startswith(_PREFIX):
        raise InputError(f"target '{target}': write {_PREFIX}BOARD, e.g. {_PREFIX}mps2-an386")
    return target[len(_PREFIX) :]


def _print(reports: list[CostReport], charges: int, states: int) -> None:
    table = Table("board", "instructions of", "least", "median", "worst", "worst of the search")
    for report in reports:
        for kind, figures in report.costs.items():
            table.add_row(
                report.board,
                kind.replace("_", " "),
                str(figures.charge_minimum),
                str(figures.charge_median),
                str(figures.charge_worst),
                str(figures.search_worst),
            )
        table.add_section()
    Console().print(table)
    typer.echo(
        f"least, median and worst over a whole charge; searched: {charges} beginnings of charges, "
        f"and {states} states a generation. Instructions, not cycles."
    )
