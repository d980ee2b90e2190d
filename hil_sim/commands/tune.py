"""`bms tune`: gains and growth limit that fill a preset's cell fastest, under the certificate."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from bms.commands.options import JsonOption, ModelOption, PresetOption
from bms.errors import InputError
from bms.files import write_text
from bms.identification.preset_toml import preset_toml
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET, Preset
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.studies.tuning.charges import outcomes, tuning_starts
from hil_sim.studies.tuning.gap import PART_NAMES, Gap, gaps
from hil_sim.studies.tuning.search import Tuned
from hil_sim.studies.tuning.search import tune as search

_USUAL_SETS = 100
"""Sets of gains that a search tries, about."""


def tune(
    preset: PresetOption = DEFAULT_PRESET,
    model: ModelOption = None,
    gap: Annotated[
        bool,
        typer.Option(
            "--gap",
            help="No search: what the time of the preset as it is is made of, beside the bound "
            "that no controller can beat (needs the extra 'bench').",
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Preset with the gains found to write (.toml).")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Find the gains (1/s, 1/s^2) and the growth of the current (A/s) that charge fastest.

    The nominal cell charges from twelve starts on the firmware in C, with its sensors; the mean of
    the times counts. Only gains that 'bms verify' certifies count. The same ones come out each
    time. With --gap a table of seconds that adds up, from the bound to the time to full.

    Example: bms tune --preset lin2014 --out faster.toml
    """
    if out is not None and out.suffix != ".toml":
        raise InputError(f"--out {out}: a preset is a file with the ending .toml; change the name")
    if gap and out is not None:
        raise InputError("--gap: finds no gains to write; leave out --out")
    pair = load_pair(preset, model)
    console = Console()
    if gap:
        with waiting("charging", len(tuning_starts(pair[0])) + len(PART_NAMES) - 1) as wait:
            found = gaps(*pair, told=wait.begin)
        if as_json:
            typer.echo(json.dumps([asdict(one) for one in found], indent=1))
        else:
            _gap_table(pair[0], found).print(console)
        return
    before = Tuned(pair[0], tuple(outcomes(*pair, tuning_starts(pair[0]))))
    with waiting("tuning", _USUAL_SETS, "sets of gains") as wait:
        after = search(*pair, told=wait.begin)
    if out is not None:
        write_text(out, preset_toml(after.preset))
    if as_json:
        typer.echo(json.dumps({"before": _content(before), "after": _content(after)}, indent=1))
    else:
        _table(before, after).print(console)


def _content(tuned: Tuned) -> dict[str, Any]:
    return {
        "gains": asdict(tuned.preset.gains),
        "current_growth_A_per_s": tuned.preset.limits.current_growth_A_per_s,
        "charge_times_s": [one.time_s for one in tuned.outcomes],
        "mean_s": tuned.mean_s,
    }


def _table(before: Tuned, after: Tuned) -> TextTable:
    table = TextTable(
        "", "preset", "fastest", title=f"{before.preset.name}: gains under the certificate"
    )
    rows = [(name, *_gains(before, after, name)) for name in asdict(after.preset.gains)]
    growth = [str(one.preset.limits.current_growth_A_per_s) for one in (before, after)]
    rows.append(("current_growth_A_per_s", growth[0], growth[1]))
    for row in rows:
        if row[1:] != ("None", "None"):
            table.add_row(*row)
    table.add_section()
    means = (f"{one.mean_s:.1f} s" for one in (before, after))
    table.add_row("time to full, geometric mean of 12", *means)
    return table


def _gains(before: Tuned, after: Tuned, name: str) -> tuple[str, str]:
    values = (getattr(one.preset.gains, name) for one in (before, after))
    first, second = (
        "1/(Rc Cc)" if value is None and name == "alpha2_per_s" else str(value) for value in values
    )
    return first, second


def _gap_table(preset: Preset, found: list[Gap]) -> TextTable:
    table = TextTable(
        "", "mean", "share", "most", title=f"{preset.name}: time to full over the bound"
    )
    count, bounds_s = len(found), [one.bound_s for one in found]
    mean_bound_s = sum(bounds_s) / count

    def add(name: str, values_s: list[float]) -> None:
        mean_s = sum(values_s) / count
        most = max(value_s / bound_s for value_s, bound_s in zip(values_s, bounds_s))
        shares = (f"{100.0 * mean_s / mean_bound_s:.2f} %", f"{100.0 * most:.2f} %")
        table.add_row(name, f"{mean_s:.2f} s", *shares)

    add("bound by physics alone", bounds_s)
    for place, name in enumerate(PART_NAMES):
        add(f"+ {name}", [one.parts_s[place] for one in found])
    table.add_section()
    add("time to full", [one.time_s for one in found])
    return table
