"""What `bms replay` does with --cells: a pack's log on the present firmware."""

from __future__ import annotations

import json
from pathlib import Path

from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.logs import Selection
from hil_sim.pack.replay import Comparison, as_dict, replay_pack
from hil_sim.pack.settings import PackChargeSettings


def replay_and_print(
    log: Path, settings: PackChargeSettings, selection: Selection, as_json: bool
) -> int:
    """Replay a pack's log, print what differs, and return the exit code."""
    with waiting("replaying", 1, "log") as wait:
        wait.begin(f"replaying {log.name}")
        comparison = replay_pack(log, settings, selection)
    if as_json:
        print(json.dumps(as_dict(log, settings, comparison), indent=2))
    else:
        _print(Console(), settings, comparison)
    return EXIT_DONE if comparison.is_equal else EXIT_CHECK_FAILED


def _print(console: Console, settings: PackChargeSettings, comparison: Comparison) -> None:
    console.print(
        f"{settings.cells} cells of {settings.preset.name}: {comparison.periods} periods, "
        f"{comparison.frames} frames; "
        + ("the same answers" if comparison.is_equal else "answers that DIFFER")
    )
    first = comparison.first
    if first is None:
        return
    table = TextTable("signal", "in the log", "now")
    for name, values in first.signals.items():
        table.add_row(name, *("n/a" if value is None else f"{value:.8g}" for value in values))
    console.print(
        f"{comparison.differing_periods} periods differ; the first is {first.period} "
        f"({first.time_s:g} s)"
    )
    table.print(console)
