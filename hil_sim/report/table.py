"""The short table on the terminal."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from bms.text_table import TextTable, red
from hil_sim.report.figures import figures
from hil_sim.report.timing import timing_figures
from hil_sim.run.result import RunResult
from hil_sim.run.settings import Settings


def print_table(
    console: Console, settings: Settings, results: list[RunResult], out: Path | None
) -> None:
    """Figures of each run beside their limits, the verdict, and where the report lies."""
    preset, first = settings.preset, results[0].summary
    table = TextTable(
        "",
        *(result.summary.controller for result in results),
        "limit",
        title=f"Charge of '{preset.name}' over {settings.bus}",
    )
    punctuality = timing_figures(results)
    for line in [*figures(preset.limits, results), *punctuality]:
        if punctuality and line is punctuality[0]:
            table.add_section()
        cells = [red(text) if kept is False else text for text, kept in zip(line.values, line.kept)]
        table.add_row(line.name, *cells, line.limit)
    table.print(console)
    if first.passed:
        console.print(f"{first.controller}: every limit kept at every sub-step of the plant")
    else:
        reasons = "; ".join(first.failures)
        console.print(f"[red]{first.controller}: check failed: {reasons}[/red]")
    if out is not None:
        console.print(f"report: {out / 'report.html'}", soft_wrap=True, markup=False)
