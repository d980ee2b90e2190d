"""`bms optimum`: the time to full that no controller can beat."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from bms.commands import options
from bms.files import make_folder, write_bytes, write_text
from bms.presets import DEFAULT_PRESET, load_preset
from bms.studies.optimum.answer import Case, cases
from bms.studies.optimum.bound import SAMPLES
from bms.studies.optimum.charge import Charge, charge_of
from bms.studies.optimum.chart import chart
from bms.studies.optimum.program import solver
from bms.text_table import TextTable
from bms.waiting import waiting

_ROWS = 12


def optimum(
    preset: options.PresetOption = DEFAULT_PRESET,
    start_K: Annotated[
        float | None,
        typer.Option(
            "--start", help="Temperature of cell and coolant at the start in K. Default: preset's."
        ),
    ] = None,
    soc: Annotated[
        float | None,
        typer.Option("--soc", help="State of charge at the start, 0 to 1. Default: preset's."),
    ] = None,
    cooling_W: Annotated[
        float | None, typer.Option("--cooling", help="Cooling power in W. Default: preset's.")
    ] = None,
    ramp: Annotated[
        bool,
        typer.Option(
            "--ramp/--no-ramp", help="The second bound, with the preset's ramp and current map."
        ),
    ] = True,
    samples: Annotated[
        int,
        typer.Option("--samples", min=20, max=2000, help="Samples of the time; more are closer."),
    ] = SAMPLES,
    out: Annotated[Path | None, options.out_folder_option("optimum.json and optimum.png")] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Tell the least time (s) in which any controller can fill the preset's nominal cell.

    Proven by duality for every current (A) over time, clairvoyant ones included, that keeps the
    preset's limits: by physics alone, and with the preset's ramp and current map as well. Beside
    it stand charges of the cell model that come close, so that the truth lies between the two.
    The last bound's current, which the proof came from, is shown as a profile.

    Example: bms optimum --preset lin2014 --start 313 --out out/optimum
    """
    loaded = load_preset(preset)
    charge = charge_of(loaded, start_K, soc, cooling_W)
    solver()  # refused here, before anything is said to be done
    if out is not None:
        make_folder(out)
    with waiting("optimum", 2.0 if ramp else 1.0, "bounds") as wait:
        answers = cases(charge, with_ramp=ramp, samples=samples, told=wait.reach)
    text = json.dumps(_content(loaded.name, charge, answers), indent=1)
    title = (
        f"{loaded.name} from {charge.start_K:g} K, state of charge {charge.start_soc:g}, "
        f"cooling {charge.cooling_W:g} W"
    )
    if out is not None:
        write_text(out / "optimum.json", text + "\n")
        write_bytes(out / "optimum.png", chart(title, answers))
    if as_json:
        typer.echo(text)
    else:
        _print(title, answers)


def _content(name: str, charge: Charge, answers: list[Case]) -> dict[str, Any]:
    return {
        "preset": name,
        "temperature_K": charge.start_K,
        "soc": charge.start_soc,
        "cooling_power_W": charge.cooling_W,
        "full_soc": charge.limits.completion_soc,
        "optimum_time_s": answers[0].stated_s,
        "lower_bound_s": answers[1].stated_s if len(answers) > 1 else None,
        "bounds": [case.to_json() for case in answers],
    }


def _print(title: str, answers: list[Case]) -> None:
    table = TextTable(
        "bound", "full at least after", "finer samples", "constant, then riding", "fastest played",
        title=title,
    )  # fmt: skip
    for case in answers:
        table.add_row(
            case.name,
            f"{case.stated_s:.1f} s",
            f"+{case.bound.slack_s:.1f} s",
            _over(case, case.constant_s),
            _over(case, case.reached_s),
        )
    table.print()
    last = answers[-1]
    headings = ("time s", "current A", "SoC", "core K", "surface K")
    profile = TextTable(*headings, title=f"current of the bound {last.name}")
    bound = last.bound
    for k in np.unique(np.linspace(0, bound.samples - 1, _ROWS).round().astype(int)).tolist():
        core_K, surface_K, _ = bound.temperatures_K[k]
        profile.add_row(
            f"{bound.time_s * k / bound.samples:.1f}",
            f"{-bound.current_A[k]:.2f}",
            f"{bound.soc[k]:.3f}",
            f"{core_K:.2f}",
            f"{surface_K:.2f}",
        )
    profile.print()


def _over(case: Case, time_s: float | None) -> str:
    return "–" if time_s is None else f"{time_s:.1f} s ({time_s / case.bound.time_s:.3f})"
