"""`bms cost`: what the firmware's work costs on an emulated microcontroller."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import JsonOption, PresetOption, seed_option
from bms.firmware.calibration import calibration_bytes
from bms.model.model_file import load_shipped_model
from bms.presets import DEFAULT_PRESET, load_preset
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.report.folder import OutputFolder
from hil_sim.run.settings import Settings
from hil_sim.studies.bench.aims import HARD_FLOAT, PERIOD_INSTRUCTIONS
from hil_sim.studies.bench.board import counted_board
from hil_sim.studies.bench.limits import period_breakdown
from hil_sim.studies.bench.machine import this_machine
from hil_sim.studies.bench.run import Result
from hil_sim.studies.bench.tables import print_breakdown, print_limits
from hil_sim.studies.cost import PARTS, CostReport, measure_cost
from hil_sim.studies.cost.by_function import WITHOUT_PLANNER, instructions_by_function
from hil_sim.studies.cost.charges import charge_records
from hil_sim.studies.cost.chart import cost_chart
from hil_sim.targets.catalog import BOARD_NAMES, board_name, built_folder


def cost(
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target",
            help=f"Board: {' or '.join(BOARD_NAMES)}. May be repeated. Default: both of them.",
        ),
    ] = None,
    preset: PresetOption = DEFAULT_PRESET,
    seed: Annotated[int, seed_option("sensor noise and search")] = 0,
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
        Path | None,
        typer.Option("--out", dir_okay=False, help="PNG with the instructions over the charge."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Count instructions of estimate, decision and control period over a charge and a search.

    The tables of the preset and its shipped model run on a board in QEMU, whose time advances by
    the same step with every instruction. A family's observation is counted with estimate and
    decision. These are instructions, not clock cycles: memory has no wait states, and a division or
    a square root counts one. `make cost` builds the programs. Exit code 1 beyond --limit.

    Example: bms cost --target qemu:mps2-an386 --limit 1500 --out cost.png
    """
    loaded = load_preset(preset)
    # The program has the default preset's compiled in.
    calibration = (
        None
        if preset == DEFAULT_PRESET
        else calibration_bytes(loaded, load_shipped_model(loaded.name, preset))
    )
    boards = [board_name(name) for name in target or BOARD_NAMES]
    with OutputFolder(out.parent) if out is not None else nullcontext() as folder:
        reports = []
        with waiting("counting", len(boards) * PARTS, "parts") as wait:
            for board in boards:
                program = built_folder(board) / "cost.elf"
                reports.append(
                    measure_cost(
                        program, board, loaded, seed, charges, states, wait.begin, calibration
                    )
                )
        if folder is not None and out is not None:
            picture = cost_chart(reports, loaded.timing.sampling_period_s)
            folder.path(out.name).write_bytes(picture)
            folder.commit()
    if as_json:
        typer.echo(json.dumps([report.to_json() for report in reports], indent=1))
    else:
        _print(reports, charges, states)
        if preset == DEFAULT_PRESET:
            _print_limits(reports)
    worst = max(report.costs["estimate_and_decision"].worst for report in reports)
    if limit is not None and worst > limit:
        typer.echo(f"estimate and decision: {worst} instructions, allowed {limit}", err=True)
        return EXIT_CHECK_FAILED
    return EXIT_DONE


def _print(reports: list[CostReport], charges: int, states: int) -> None:
    table = TextTable("board", "instructions of", "least", "median", "worst", "worst of the search")
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
    table.print()
    typer.echo(
        f"least, median and worst over a whole charge; searched: {charges} beginnings of charges, "
        f"and {states} states a generation. Instructions, not cycles."
    )


def _print_limits(reports: list[CostReport]) -> None:
    """What a period and the flash are made of, and the aims of the default preset."""
    console = Console()
    if any(report.board == HARD_FLOAT for report in reports):
        begin, count = WITHOUT_PLANNER
        records = charge_records(Settings(load_preset(DEFAULT_PRESET))).records[: begin + count]
        program = built_folder(HARD_FLOAT) / "cost.elf"
        counts = instructions_by_function(program, HARD_FLOAT, records, count)
        print_breakdown(console, period_breakdown(HARD_FLOAT, counts, PERIOD_INSTRUCTIONS))
    print_limits(console, Result(this_machine(), board=list(map(counted_board, reports))))
