"""`bms campaign`: thousands of charges of cells that differ from the nominal one."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import (
    DEFAULT_PROCESSES,
    JsonOption,
    ModelOption,
    PresetOption,
    out_folder_option,
    seed_option,
)
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from bms.waiting import waiting
from hil_sim.commands import options
from hil_sim.run.workforce import Workforce, dask_workforce, local_workforce
from hil_sim.studies.campaign.histogram import save_histograms
from hil_sim.studies.campaign.run import run_campaign
from hil_sim.studies.campaign.settings import CampaignSettings
from hil_sim.studies.campaign.store import CampaignFolder
from hil_sim.studies.campaign.summary import firmware_is_safe, summarise


def campaign(
    runs: Annotated[int, typer.Option("--runs", min=1, help="Number of cells to charge.")] = 1000,
    jobs: options.JobsOption = DEFAULT_PROCESSES,
    preset: PresetOption = DEFAULT_PRESET,
    model: ModelOption = None,
    seed: Annotated[int, seed_option("cells, disturbances and sensor noise")] = 0,
    max_time_s: options.MaxTimeOption = 3600.0,
    out: Annotated[
        Path, out_folder_option("runs.csv, summary.json and histograms.png", default=None)
    ] = Path("out/campaign"),
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the interrupted campaign in the folder.")
    ] = False,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Run on a Dask cluster, for example tcp://host:8786."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Charge many cells with KAN-rCBF, S-CBF and CC-CV and count crossed limits.

    Core and surface parameters are drawn from published intervals, with start states, cooling
    powers, disturbances and sensor noise; the firmware keeps the nominal constants. runs.csv
    depends on the options but not on jobs or scheduler; Ctrl-C keeps finished runs. Exit code 1
    when KAN-rCBF crosses a limit for a cell inside the modelled uncertainty.

    Example: bms campaign --runs 10000 --jobs 2 --preset lin2014 --out out/campaign
    """
    settings = CampaignSettings(
        *load_pair(preset, model), runs=runs, seed=seed, max_time_s=max_time_s
    )
    workforce = local_workforce(jobs) if scheduler is None else dask_workforce(scheduler)
    with workforce as force:
        folder = CampaignFolder(out, settings, resume)
        start_s = time.perf_counter()
        done = _run(settings, folder, force)
        wall_time_s = time.perf_counter() - start_s
    folder.finish()
    rows = folder.rows()
    summary = summarise(settings, rows) | {
        "runs_in_this_session": done,
        "wall_time_s": round(wall_time_s, 3),
        "runs_per_s": round(done / wall_time_s, 3),
    }
    folder.write("summary.json", json.dumps(summary, indent=2) + "\n")
    save_histograms(settings, rows, out / "histograms.png")
    if as_json:
        print(json.dumps(summary, indent=2))
    else:
        _print(Console(), summary, out)
    return EXIT_DONE if firmware_is_safe(summary) else EXIT_CHECK_FAILED


def _run(settings: CampaignSettings, folder: CampaignFolder, workforce: Workforce) -> int:
    done = settings.runs - sum(map(len, folder.unfinished()))
    try:
        with waiting("charging", settings.runs, "runs", done) as wait:
            return run_campaign(settings, folder, workforce, wait.advance)
    except KeyboardInterrupt:
        kept = settings.runs - sum(map(len, folder.unfinished()))
        print(
            f"bms: {kept} of {settings.runs} runs are kept in {folder.path}; go on with --resume",
            file=sys.stderr,
        )
        raise


def _print(console: Console, summary: dict[str, Any], out: Path) -> None:
    for name, cells in summary["classes"].items():
        table = Table(
            title=f"{cells['runs']} cells {name} the modelled uncertainty: runs that cross a limit",
            title_justify="left",
            box=SIMPLE,
            padding=(0, 1, 0, 0),
        )
        for heading in _HEADINGS:
            table.add_column(heading, justify="left" if heading == _HEADINGS[0] else "right")
        for controller, figures in cells["controllers"].items():
            table.add_row(controller, *_cells(figures))
        console.print(table)
        if cells["estimate_beyond_error_bound"]:
            console.print(
                f"in {cells['estimate_beyond_error_bound']} of them the core estimate was wrong by "
                f"more than its bound of {summary['estimation_error_bound_K']:.3f} K"
            )
    console.print(
        f"{summary['runs_in_this_session']} runs in {summary['wall_time_s']:.1f} s "
        f"({summary['runs_per_s']:.1f} a second); written to {out}"
    )


_COUNTS = ("core", "surf.", "volt.", "soc", "any")
_HEADINGS = ("", *_COUNTS, "any, 95 %", "peak K", "time s", "not full")


def _cells(figures: dict[str, Any]) -> list[str]:
    violations, times = figures["violations"], figures["charge_time_s"]
    anything, peak = violations["any"], figures["peaks"]["max_core_temperature_K"]
    ends = figures["outcomes"]
    return [
        *(str(violation["count"]) for violation in violations.values()),
        "" if anything["low"] is None else f"{anything['low']:.2g}..{anything['high']:.2g}",
        "" if peak is None else f"{peak['max']:.2f}",
        "" if times is None else f"{times['median']:.0f}",
        str(sum(ends.values()) - ends.get("complete", 0)),
    ]
