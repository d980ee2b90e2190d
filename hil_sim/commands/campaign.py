"""`bms campaign`: thousands of charges of cells that differ from the nominal one."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Annotated

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
from bms.waiting import waiting
from hil_sim.bus.catalog import Mode
from hil_sim.commands import options
from hil_sim.commands.campaign_output import print_classes, print_family
from hil_sim.commands.charge_mode import ChargeMode
from hil_sim.run.workforce import Workforce, dask_workforce, local_workforce
from hil_sim.studies.campaign.nominal import NominalPart
from hil_sim.studies.campaign.real_summary import family_is_safe, summarise_family
from hil_sim.studies.campaign.run import run_campaign
from hil_sim.studies.campaign.settings import CampaignSettings, CellFamily, default_max_time_s
from hil_sim.studies.campaign.store import CampaignFolder
from hil_sim.studies.campaign.summary import firmware_is_safe, summarise


def campaign(
    runs: Annotated[int, typer.Option("--runs", min=1, help="Number of cells to charge.")] = 1000,
    jobs: options.JobsOption = DEFAULT_PROCESSES,
    preset: PresetOption = DEFAULT_PRESET,
    model: ModelOption = None,
    seed: Annotated[int, seed_option("cells, disturbances and sensor noise")] = 0,
    family: Annotated[
        CellFamily,
        typer.Option(
            "--family",
            help="published: core and surface as in the literature, and known otherwise. real: "
            "all that the preset's [cell.interval], plug-in errors and supply admit.",
        ),
    ] = CellFamily.PUBLISHED,
    nominal_part: Annotated[
        NominalPart | None,
        typer.Option(
            "--nominal-part",
            help="Let the firmware take this part of a real family for nominal: what it is for.",
        ),
    ] = None,
    mode: Annotated[
        ChargeMode | None,
        typer.Option(
            "--mode",
            help="What the charger asks KAN-rCBF for beside the reference current: to follow it "
            "(fixed), or the fastest charge. Default: nothing, which is the fastest.",
        ),
    ] = None,
    max_time_s: Annotated[
        float | None,
        typer.Option(
            "--max-time-s",
            min=0.1,
            help="End of a charge in s after it began. Default: 3600, of family real 10800, "
            "or what the weakest current of the preset's map needs.",
        ),
    ] = None,
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
    when KAN-rCBF crosses a limit for a cell inside the modelled uncertainty; with a real family
    for any cell, or overfills one, says "complete" too early, ends in a fault, or fills fewer than
    99 % in time.

    Example: bms campaign --runs 10000 --jobs 2 --preset lin2014 --out out/campaign
    """
    chosen, estimator = load_pair(preset, model)
    settings = CampaignSettings(
        chosen,
        estimator,
        runs=runs,
        seed=seed,
        max_time_s=default_max_time_s(chosen, family) if max_time_s is None else max_time_s,
        family=family,
        nominal_part=nominal_part,
        mode=None if mode is None else Mode[mode.name],
    )
    is_real = family is CellFamily.REAL
    workforce = local_workforce(jobs) if scheduler is None else dask_workforce(scheduler)
    with workforce as force:
        folder = CampaignFolder(out, settings, resume)
        start_s = time.perf_counter()
        done = _run(settings, folder, force)
        wall_time_s = time.perf_counter() - start_s
    folder.finish()
    rows = folder.rows()
    summary = (summarise_family if is_real else summarise)(settings, rows) | {
        "runs_in_this_session": done,
        "wall_time_s": round(wall_time_s, 3),
        "runs_per_s": round(done / wall_time_s, 3),
    }
    folder.write("summary.json", json.dumps(summary, indent=2) + "\n")
    # It loads matplotlib, which the processes of a campaign have no use for.
    from hil_sim.studies.campaign.histogram import save_histograms  # noqa: PLC0415

    save_histograms(settings, rows, out / "histograms.png")
    if as_json:
        print(json.dumps(summary, indent=2))
    else:
        (print_family if is_real else print_classes)(Console(), summary)
        print(
            f"{summary['runs_in_this_session']} runs in {summary['wall_time_s']:.1f} s "
            f"({summary['runs_per_s']:.1f} a second); written to {out}"
        )
    is_safe = family_is_safe(summary) if is_real else firmware_is_safe(summary)
    return EXIT_DONE if is_safe else EXIT_CHECK_FAILED


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
