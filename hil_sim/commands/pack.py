"""`bms pack`: cells in series that differ, charged by the weakest, by one cell and by the mean."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

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
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.commands import options
from hil_sim.commands.pack_options import FlowOption, NeighbourOption
from hil_sim.report.folder import OutputFolder
from hil_sim.run.workforce import local_workforce
from hil_sim.studies.pack.settings import PackSettings
from hil_sim.studies.pack.spread import Surroundings
from hil_sim.studies.pack.study import run_study
from hil_sim.studies.pack.summary import claim_holds, summarise


def pack(
    cells: Annotated[int, typer.Option("--cells", min=1, help="Cells in series.")] = 16,
    packs: Annotated[int, typer.Option("--packs", min=1, help="Number of packs to charge.")] = 1000,
    neighbour_W_per_K: NeighbourOption = Surroundings.neighbour_W_per_K,
    flow_W_per_K: FlowOption = Surroundings.flow_W_per_K,
    preset: PresetOption = DEFAULT_PRESET,
    model: ModelOption = None,
    seed: Annotated[int, seed_option("cells, disturbances and sensor noise")] = 0,
    max_time_s: options.MaxTimeOption = 3600.0,
    jobs: options.JobsOption = DEFAULT_PROCESSES,
    out: Annotated[Path | None, out_folder_option("summary.json and packs.json")] = None,
    as_json: JsonOption = False,
) -> int:
    """Charge packs of cells that differ and count the cells that cross a limit.

    The control core gives each cell bounds of its own and takes the current that all admit, with a
    thermistor at each cell and at one of 2, 4 and 8. Beside it charge the same core seeing one
    cell, or the mean, and one without what the cells' spread needs in reserve. Times are those
    until the fullest cell is full, beside the slowest cell alone. The result depends on the options
    but not on jobs. Exit code 1 when a cell crosses a limit under the first ones, or a pack does
    not become full.

    Example: bms pack --cells 16 --packs 1000 --jobs 2 --out out/pack
    """
    chosen, estimator = load_pair(preset, model)
    settings = PackSettings(
        chosen,
        estimator,
        cells=cells,
        packs=packs,
        seed=seed,
        max_time_s=max_time_s,
        around=Surroundings(neighbour_W_per_K, flow_W_per_K),
    )
    # The folder is tried before the packs are charged.
    with OutputFolder(out) if out is not None else nullcontext() as folder:
        with waiting("charging", packs, "packs") as wait, local_workforce(jobs) as workforce:
            rows = run_study(settings, workforce, wait.advance)
        summary = summarise(settings, rows)
        if folder is not None:
            folder.path("summary.json").write_text(json.dumps(summary, indent=2) + "\n")
            folder.path("packs.json").write_text(json.dumps(rows) + "\n")
            folder.commit()
    if as_json:
        print(json.dumps(summary, indent=2))
    else:
        print_packs(Console(), summary)
    return EXIT_DONE if claim_holds(summary) else EXIT_CHECK_FAILED


def print_packs(console: Console, summary: dict[str, Any]) -> None:
    """Table of the controllers, and what the cells do to each other."""
    settings, coupling = summary["settings"], summary["coupling"]
    table = TextTable(
        "",
        "packs over",
        "cells over",
        "core K",
        "volt. mV",
        "full",
        "time s",
        "of alone",
        "worst",
        title=f"{settings['packs']} packs of {settings['cells']} cells of {settings['preset']}",
    )
    for name, figures in summary["controllers"].items():
        table.add_row(
            name,
            str(figures["packs_over"]),
            str(figures["cells_over"]),
            f"{figures['worst']['core_K']:+.2f}",
            f"{1000.0 * figures['worst']['voltage_V']:+.1f}",
            str(figures["packs_full"]),
            f"{figures['time_s']['median']:.1f}",
            f"{figures['over_slowest_alone']['median']:.3f}",
            f"{figures['over_slowest_alone']['most']:.3f}",
        )
    table.print(console)
    console.print(
        "over: a limit crossed at any instant; core, volt.: worst excess; of alone: time to full "
        f"over that of the slowest cell alone (median {summary['slowest_alone_s']['median']:.1f} s)"
    )
    console.print(
        f"neighbours change a surface by {coupling['surface_K_per_s']:.2g} K/s at most; "
        f"{_covers(coupling['preset_covers_surface'])} the preset's bound of "
        f"{coupling['preset_surface_K_per_s']:.2g} K/s"
        + (
            ""
            if coupling["reserved_surface_K_per_s"] is None
            else f", {_covers(coupling['reserve_covers_surface'])} the pack's reserve of "
            f"{coupling['reserved_surface_K_per_s']:.2g} K/s"
        )
    )


def _covers(is_covered: bool) -> str:
    return "within" if is_covered else "beyond"
