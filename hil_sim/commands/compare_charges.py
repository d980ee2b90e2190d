"""`bms compare-charges`: times to full beside the bound that no controller can beat."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import nullcontext
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import DEFAULT_PROCESSES, JsonOption, out_folder_option, seed_option
from bms.errors import InputError
from bms.studies.optimum.program import solver
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.commands import options
from hil_sim.report.folder import OutputFolder
from hil_sim.run.workforce import Workforce, local_workforce
from hil_sim.studies.charge_times.chart import comparison_chart
from hil_sim.studies.charge_times.comparison import compare, content_json, on_workforce
from hil_sim.studies.charge_times.family import charge_family, family_json
from hil_sim.studies.charge_times.prediction import foretell, prediction_json
from hil_sim.studies.charge_times.starts import Start, all_starts
from hil_sim.studies.charge_times.tables import (
    asked_table,
    controllers_table,
    csv_text,
    family_table,
    prediction_table,
    starts_table,
)


class What(str, Enum):
    """What is compared with the bound, by its name on the command line."""

    CONTROLLERS = "controllers"
    PREDICTION = "prediction"
    FAMILY = "family"


def compare_charges(
    what: Annotated[
        What,
        typer.Option(
            "--what",
            help="controllers: all of them from 24 starts. prediction: the time to full that the "
            "firmware tells, and the one that it is asked to keep. family: cells of "
            "a123_26650_10C, each beside its own bound.",
        ),
    ] = What.CONTROLLERS,
    starts: Annotated[
        list[str] | None,
        typer.Option(
            "--starts",
            help="Starts whose name contains this, such as 'lin2014 298 K, SoC 0.5'. May be "
            "repeated. Default: all 24.",
        ),
    ] = None,
    runs: Annotated[
        int, typer.Option("--runs", min=1, help="Number of cells of --what family.")
    ] = 100,
    seed: Annotated[int, seed_option("the cells of --what family")] = 0,
    out: Annotated[
        Path | None,
        out_folder_option("summary.json; of controllers charges.csv and charges.png too"),
    ] = None,
    as_json: JsonOption = False,
    jobs: options.JobsOption = DEFAULT_PROCESSES,
) -> int:
    """Compare charging times with the least (s) that any controller can need.

    Starts are those of both presets at 283, 298 and 313 K, states of charge of 0.01 and 0.5, half
    and full cooling; the bounds are those of `bms optimum`. Beside KAN-rCBF, planned and at its
    reference, charge S-CBF, CC-CV (at the reference, at the data sheet's 10 A, and tuned in
    hindsight for each start), multi-stage constant current, and a model-predictive controller that
    knows the true state. Takes some minutes; needs the extra `bench`. Exit code 1 when KAN-rCBF
    crosses a limit or does not fill a cell; when a prediction is off by more than 5 % (of a family
    20 %) or a time in reach is not kept; when the family's median is above 1.2 times the bound.

    Example: bms compare-charges --out out/charges
    """
    if starts and what is What.FAMILY:
        raise InputError("--starts: cells of a family have starts of their own; leave it out")
    chosen = _chosen(starts)
    solver()  # refused here, before anything is said to be done
    with OutputFolder(out) if out is not None else nullcontext() as folder:
        with local_workforce(jobs) as force:
            content = _content(what, chosen, range(runs), seed, force)
        text = json.dumps(content, indent=1)
        if folder is not None:
            folder.path("summary.json").write_text(text + "\n", encoding="utf-8")
            if what is What.CONTROLLERS:
                folder.path("charges.csv").write_text(csv_text(content), encoding="utf-8")
                folder.path("charges.png").write_bytes(comparison_chart(content))
            folder.commit()
    if as_json:
        print(text)
    else:
        _print(Console(), what, content)
    return EXIT_DONE if content["passed"] else EXIT_CHECK_FAILED


def _content(
    what: What, starts: Sequence[Start], runs: Sequence[int], seed: int, force: Workforce
) -> dict[str, Any]:
    if what is What.FAMILY:
        with waiting("charging", len(runs), "cells") as wait:
            charge = partial(charge_family, seed=seed)
            return family_json(on_workforce(charge, runs, force, wait.advance))
    with waiting("charging", len(starts), "starts") as wait:
        if what is What.PREDICTION:
            return prediction_json(on_workforce(foretell, starts, force, wait.advance))
        return content_json(on_workforce(compare, starts, force, wait.advance))


_TABLES = {
    What.CONTROLLERS: (starts_table, controllers_table),
    What.PREDICTION: (prediction_table, asked_table),
    What.FAMILY: (family_table,),
}


def _print(console: Console, what: What, content: dict[str, Any]) -> None:
    for make in _TABLES[what]:
        table: TextTable = make(content)
        table.print(console)
    if not content["passed"]:
        console.print("[red]check failed: see `bms compare-charges --help` for what is held[/red]")


def _chosen(wanted: list[str] | None) -> list[Start]:
    """The starts whose names contain one of the texts, all without any; InputError for none."""
    known = all_starts()
    for text in wanted or []:
        if not any(text in start.name for start in known):
            raise InputError(
                f"--starts '{text}': no start is called so; take a part of such as "
                f"'{known[0].name}'"
            )
    return [start for start in known if not wanted or any(text in start.name for text in wanted)]
