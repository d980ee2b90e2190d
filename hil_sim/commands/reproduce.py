"""`bms reproduce`: the paper's table and figures beside ours."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.text import Text

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import DEFAULT_PROCESSES, JsonOption, out_folder_option
from bms.presets import Preset, load_preset
from bms.presets.paper_form import in_paper_form
from bms.text_table import TextTable, red
from bms.waiting import waiting
from hil_sim.commands import options
from hil_sim.report.folder import OutputFolder
from hil_sim.studies.reproduction.files import CAUTION, content_json, write_reproduction
from hil_sim.studies.reproduction.runs import PRESETS, Results, all_cases, run_cases
from hil_sim.studies.reproduction.sections import BAD, Section, passed, sections


def reproduce(
    out: Annotated[
        Path | None,
        out_folder_option("report.html, reproduce.json, reproduce.csv and the pictures"),
    ] = None,
    as_json: JsonOption = False,
    seed: options.SeedOption = 0,
    jobs: options.JobsOption = DEFAULT_PROCESSES,
    max_time_s: options.MaxTimeOption = 3600.0,
) -> int:
    """Run the paper's comparison on both presets, with its gains, and show its figures beside ours.

    Every controller charges under every disturbance; then the firmware charges without one of its
    margins at a time, which shows what that margin costs. Peaks in K, times in s from the start of
    the charge. Exit code 1 when the firmware lets a limit be crossed or a charge of it fails.

    Example: bms reproduce --out out/reproduce
    """
    cases, presets = all_cases(), [in_paper_form(load_preset(name)) for name in PRESETS]
    with OutputFolder(out) if out is not None else nullcontext() as folder:
        with waiting("charging", len(cases), "charges") as wait:
            results = run_cases(cases, seed, jobs, max_time_s, wait.advance)
        if folder is not None:
            write_reproduction(folder, presets, results, seed)
            folder.commit()
    if as_json:
        print(json.dumps(content_json(presets, results, seed), indent=2))
    else:
        _print(Console(), presets, results, out)
    return EXIT_DONE if passed(results) else EXIT_CHECK_FAILED


def _print(console: Console, presets: Sequence[Preset], results: Results, out: Path | None) -> None:
    for preset in presets:
        for section in sections(preset, results):
            _table(section).print(console)
            for note in section.notes:
                console.print(f"  {note}", markup=False, highlight=False)
            console.print()
    console.print(CAUTION, markup=False, highlight=False)
    if passed(results):
        console.print("KAN-rCBF kept every limit in every charge")
    else:
        console.print("[red]KAN-rCBF: check failed, see the figures in red[/red]")
    if out is not None:
        console.print(f"report: {out / 'report.html'}", soft_wrap=True, markup=False)


def _table(section: Section) -> TextTable:
    table = TextTable(*section.columns, title=section.title)
    for row in section.rows:
        table.add_row(*(_cell(text) for text in row))
    return table


def _cell(text: str) -> str | Text:
    return red(text) if text.endswith(BAD) else text
