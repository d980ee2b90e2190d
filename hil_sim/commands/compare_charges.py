"""`bms compare-charges`: times to full beside the bound that no controller can beat."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import DEFAULT_PROCESSES, JsonOption, out_folder_option
from bms.errors import InputError
from bms.studies.optimum.program import solver
from bms.waiting import waiting
from hil_sim.commands import options
from hil_sim.report.folder import OutputFolder
from hil_sim.run.workforce import local_workforce
from hil_sim.studies.charge_times.chart import comparison_chart
from hil_sim.studies.charge_times.comparison import compare, content_json, on_workforce
from hil_sim.studies.charge_times.starts import Start, all_starts
from hil_sim.studies.charge_times.tables import controllers_table, csv_text, starts_table


def compare_charges(
    starts: Annotated[
        list[str] | None,
        typer.Option(
            "--starts",
            help="Starts whose name contains this, such as 'lin2014 298 K, SoC 0.5'. May be "
            "repeated. Default: all 24.",
        ),
    ] = None,
    out: Annotated[Path | None, out_folder_option("summary.json, charges.csv, charges.png")] = None,
    as_json: JsonOption = False,
    jobs: options.JobsOption = DEFAULT_PROCESSES,
) -> int:
    """Charge the nominal cell from 24 starts with every controller, beside the least time (s).

    Starts are those of both presets at 283, 298 and 313 K, states of charge of 0.01 and 0.5, half
    and full cooling. The two lower bounds are those of `bms optimum`. Beside KAN-rCBF, planned and
    at its reference, charge S-CBF, CC-CV (at the reference, at the data sheet's 10 A, and tuned in
    hindsight for each start), multi-stage constant current, and a model-predictive controller that
    knows the true state. Takes some minutes; needs the extra `bench`. Exit code 1 when KAN-rCBF
    crosses a limit or does not fill a cell.

    Example: bms compare-charges --out out/charges
    """
    chosen = _chosen(starts)
    solver()  # refused here, before anything is said to be done
    with OutputFolder(out) if out is not None else nullcontext() as folder:
        with local_workforce(jobs) as force, waiting("comparing", len(chosen), "starts") as wait:
            content = content_json(on_workforce(compare, chosen, force, wait.advance))
        text = json.dumps(content, indent=1)
        if folder is not None:
            folder.path("summary.json").write_text(text + "\n", encoding="utf-8")
            folder.path("charges.csv").write_text(csv_text(content), encoding="utf-8")
            folder.path("charges.png").write_bytes(comparison_chart(content))
            folder.commit()
    if as_json:
        print(text)
    else:
        console = Console()
        starts_table(content).print(console)
        controllers_table(content).print(console)
        if not content["certified_are_safe"]:
            console.print("[red]KAN-rCBF: check failed, see the figures in red[/red]")
    return EXIT_DONE if content["certified_are_safe"] else EXIT_CHECK_FAILED


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
