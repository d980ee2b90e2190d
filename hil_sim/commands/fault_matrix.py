"""`bms fault-matrix`: every row of the fault matrix in closed loop."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import nullcontext
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import (
    DEFAULT_PROCESSES,
    JsonOption,
    ModelOption,
    PresetOption,
    out_folder_option,
)
from bms.errors import InputError
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.commands import options, pack_options
from hil_sim.fault_matrix.matrix import Row, load_matrix
from hil_sim.fault_matrix.report import (
    MatrixResult,
    expected_text,
    latch_text,
    matrix_json,
    matrix_junit,
    matrix_page,
)
from hil_sim.fault_matrix.runner import MatrixSettings, play_all
from hil_sim.fault_matrix.verdict import Verdict
from hil_sim.report.folder import OutputFolder

Play = Callable[[int, Callable[[], None]], list[Verdict]]
"""Plays rows by so many processes, and says after each that it is done."""


def fault_matrix(
    bus: options.BusOption = "virtual:faults",
    preset: PresetOption = DEFAULT_PRESET,
    model: ModelOption = None,
    seed: options.SeedOption = 0,
    rows: options.RowsOption = None,
    matrix: Annotated[
        Path | None,
        typer.Option("--matrix", help="TOML file of rows. Default: the matrix of the project."),
    ] = None,
    cells: pack_options.CellsOption = None,
    jobs: options.JobsOption = DEFAULT_PROCESSES,
    out: Annotated[
        Path | None,
        out_folder_option("fault-matrix.html, fault-matrix.json and junit.xml"),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Play every row of the fault matrix and compare reaction, deadline and limits.

    Each row is a charge with one fault, on a bus with plant and firmware in this process. Deadlines
    are in control periods from the fault's first one, which is number 1. With --cells the rows are
    those of a pack. Exit code 1 when a row does not go as it says, or a limit of the plant is
    crossed.

    Example: bms fault-matrix --rows corrupted --out out/faults
    """
    settings = MatrixSettings(*load_pair(preset, model), bus, seed)
    play: Play
    if cells is None:
        chosen = chosen_rows(load_matrix(matrix), rows)
        play = partial(play_all, settings, chosen)
    else:
        pack_options.refuse_options({"--matrix": matrix is not None})
        chosen, play = _of_pack(settings, cells, rows)
    with OutputFolder(out) if out is not None else nullcontext() as folder:
        start_s = time.perf_counter()
        with waiting("playing faults", len(chosen), "rows") as wait:
            verdicts = play(jobs, wait.advance)
        result = MatrixResult(settings, verdicts, time.perf_counter() - start_s)
        size = {} if cells is None else {"cells": cells}
        content = json.dumps(size | matrix_json(result), indent=2) + "\n"
        if folder is not None:
            folder.path("fault-matrix.json").write_text(content, encoding="utf-8")
            folder.path("junit.xml").write_text(matrix_junit(result), encoding="utf-8")
            folder.path("fault-matrix.html").write_text(matrix_page(result), encoding="utf-8")
            folder.commit()
    if as_json:
        print(content, end="")
    else:
        _print(Console(), result, out)
    return EXIT_CHECK_FAILED if result.red else EXIT_DONE


def _of_pack(
    settings: MatrixSettings, cells: int, rows: list[str] | None
) -> tuple[list[Row], Play]:
    """The rows of a pack that are asked for, and what plays them."""
    from hil_sim.pack import fault_matrix as of_pack  # noqa: PLC0415 (plots and solvers)
    from hil_sim.pack.settings import PackChargeSettings  # noqa: PLC0415

    of_pack.require_rows_fit(cells)
    pack = PackChargeSettings(
        settings.preset, settings.model, cells, bus=settings.bus, seed=settings.seed
    )
    pack.core()  # what cannot be is said before a run
    chosen = chosen_rows(of_pack.pack_rows(), rows)
    return chosen, partial(of_pack.play_rows, pack, chosen)


def chosen_rows(rows: tuple[Row, ...], patterns: list[str] | None) -> list[Row]:
    """Rows that any pattern names, in the order of the matrix; each pattern must name one."""
    if not patterns:
        return list(rows)
    found: set[str] = set()
    for pattern in patterns:
        named = {row.name for row in rows if fnmatchcase(row.name.lower(), f"*{pattern.lower()}*")}
        if not named:
            raise InputError(f"--rows '{pattern}': no row has such a name; leave it out to see all")
        found |= named
    return [row for row in rows if row.name in found]


def _print(console: Console, result: MatrixResult, out: Path | None) -> None:
    table = TextTable(
        "fault",
        "expected",
        "first 0 A",
        "latches",
        "latched",
        title=f"Fault matrix of '{result.settings.preset.name}'",
    )
    for verdict in result.red_first:
        cells = (
            verdict.row.name,
            expected_text(verdict),
            str(verdict.first_zero_period or "-"),
            latch_text(verdict),
            str(verdict.latched_period or "-"),
        )
        table.add_row(*cells, style="" if verdict.passed else "red")
    table.print(console)
    for verdict in result.red:
        failures = escape(f"{verdict.row.name}: {'; '.join(verdict.failures)}")
        console.print(f"[red]{failures}[/red]", highlight=False)
    for reason, names in result.not_applied.items():
        text = f"does not apply to '{result.settings.preset.name}': {', '.join(names)}: {reason}"
        console.print(text, markup=False, highlight=False)
    style = "red" if result.red else "green"
    seconds = f"{result.wall_time_s:.1f} s"
    console.print(f"[{style}]{result.sentence}[/{style}] ({seconds}); periods count from the fault")
    if out is not None:
        console.print(f"report: {out / 'fault-matrix.html'}", soft_wrap=True, markup=False)
