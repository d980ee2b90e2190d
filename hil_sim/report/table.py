"""The short table on the terminal."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from bms.text_table import TextTable, red
from hil_sim.report.figures import figures, has_bound
from hil_sim.report.timing import timing_figures
from hil_sim.run.result import RunResult
from hil_sim.run.settings import Settings


def print_table(
    console: Console, settings: Settings, results: list[RunResult], out: Path | None
) -> None:
    """Figures of each run beside their limits, the verdict, and where the report lies."""
    preset, first = settings.preset, results[0].summary
    punctuality = timing_figures(results)
    lines = [*figures(preset.limits, results), *punctuality]
    is_bounded = has_bound(lines)
    table = TextTable(
        "",
        *(result.summary.name for result in results),
        *(["bound"] if is_bounded else []),
        "limit",
        title=f"Charge of '{preset.name}' over {settings.bus}",
    )
    for line in lines:
        if punctuality and line is punctuality[0]:
            table.add_section()
        cells = [red(text) if kept is False else text for text, kept in zip(line.values, line.kept)]
        table.add_row(line.name, *cells, *([line.bound] if is_bounded else []), line.limit)
    table.print(console)
    if first.passed:
        console.print(f"{first.name}: every limit kept at every sub-step of the plant")
    else:
        reasons = "; ".join(first.failures)
        console.print(f"[red]{first.name}: check failed: {reasons}[/red]")
    if out is not None:
        console.print(f"report: {out / 'report.html'}", soft_wrap=True, markup=False)
