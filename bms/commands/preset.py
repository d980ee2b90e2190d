"""`bms preset`: what whoever writes a preset needs."""

from __future__ import annotations

import dataclasses
import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE, with_subcommands
from bms.commands.options import JsonOption
from bms.commands.surface_options import GeometryOption
from bms.errors import InputError
from bms.files import write_text
from bms.identification.bpx.cell import known_of
from bms.identification.bpx.file import read_bpx
from bms.presets import load_preset, preset_path
from bms.presets.authoring.complaints import complaints
from bms.presets.authoring.difference import differences, flattened
from bms.presets.authoring.form import Known, form
from bms.presets.authoring.keys import explanation
from bms.text_table import TextTable

_LONGEST_LIST = 6
"""Of what is shown whole; --json has all."""
_ONE_OF = "Name of a shipped preset, or path of a TOML file."
PresetArgument = Annotated[str, typer.Argument(metavar="PRESET", help=_ONE_OF)]


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the cell.")],
    out: Annotated[Path, typer.Option("--out", help="Preset to write (.toml); none may be there.")],
    from_bpx: Annotated[
        Path | None,
        typer.Option(
            "--from-bpx", help="BPX file (JSON or YAML) to take from what it tells; extra bpx."
        ),
    ] = None,
    geometry: GeometryOption = None,
) -> None:
    """Write an empty preset to fill in: each key with its unit (K, A, ...) and where to find it.

    No number of any cell stands in it; 'bms preset check' says what is still missing. With
    --from-bpx, capacity, open-circuit voltage, dU/dT, heat capacity, voltage limit and more stand
    in it, each with the field that it is from; with --geometry too, the resistance of the core.

    Example: bms preset new my_cell --out my_cell.toml
    """
    if out.suffix != ".toml":
        raise InputError(f"--out {out}: a preset is a file with the ending .toml; change the name")
    if out.exists():
        raise InputError(f"--out {out}: is there already; choose another name, or remove it first")
    if not name.strip():
        raise InputError("NAME: is empty; give the cell a name such as my_cell")
    if geometry is not None and from_bpx is None:
        raise InputError("--geometry: shapes the core of a BPX file; give it with --from-bpx")
    known = {} if from_bpx is None else known_of(read_bpx(from_bpx), geometry)
    write_text(out, form(name, known))
    if from_bpx is not None:
        _tell_known(known)
    print(f"{out}: fill it in, then 'bms preset check {shlex.quote(str(out))}'")


def _tell_known(known: Mapping[str, Known]) -> None:
    """What a file has told and what it has not, a line for each key."""
    for key, one in known.items():
        if one.value is not None and one.note:
            print(f"{key}: {one.note}")
    for key, one in known.items():
        if one.value is None:
            print(f"{key}: to fill in: {one.note}")


def check(preset: PresetArgument, as_json: JsonOption = False) -> int:
    """Say everything that is wrong with a preset at once: where, what, and what to do about it.

    Exit code 1 when there is something. Temperatures in K, currents in A, negative while charging.

    Example: bms preset check my_cell.toml
    """
    path = preset_path(preset)
    found = complaints(path)
    if as_json:
        content = {"file": str(path), "complaints": [dataclasses.asdict(one) for one in found]}
        print(json.dumps(content, indent=1, ensure_ascii=False))
    else:
        console = Console()
        for one in found:
            console.print(f"{one.key}: {one.what}", markup=False, highlight=False)
            console.print(f"    {one.remedy}", markup=False, highlight=False, style="dim")
        console.print(_verdict(path, len(found)), markup=False, highlight=False, soft_wrap=True)
    return EXIT_CHECK_FAILED if found else EXIT_DONE


def show(preset: PresetArgument, as_json: JsonOption = False) -> None:
    """Show a preset as a table: each key with its value and unit; with --json all of it as JSON.

    Example: bms preset show lin2014
    """
    chosen = load_preset(preset)
    if as_json:
        print(json.dumps(dataclasses.asdict(chosen), indent=1, ensure_ascii=False))
        return
    table = TextTable("key", "value", "unit", title=f"{chosen.name}: {chosen.description}")
    for key, value in flattened(chosen).items():
        if key not in {"name", "description", "sources"}:
            table.add_row(key, _text(value), _unit(key))
    table.print()
    for source in chosen.sources:
        Console().print(f"source: {source}", markup=False, highlight=False)


def diff(first: PresetArgument, second: PresetArgument, as_json: JsonOption = False) -> None:
    """Show which keys differ between two presets, and what such an edit needs to be made anew.

    'training': a new model by 'bms train'; 'certificate': 'bms verify' again; 'tables': 'bms
    export' again, as the firmware's calibration carries the hash of its preset (K, A and other
    units as in the names).

    Example: bms preset diff lin2014 my_cell.toml
    """
    found = differences(load_preset(first), load_preset(second))
    if as_json:
        content = [dataclasses.asdict(one) | {"needs": one.needs} for one in found]
        print(json.dumps(content, indent=1, ensure_ascii=False))
        return
    if not found:
        print(f"{first} and {second}: no difference")
        return
    table = TextTable("key", "first", "second", "to be made anew")
    for one in found:
        table.add_row(one.key, _text(one.first), _text(one.second), ", ".join(one.needs))
    table.print()
    needs = [need for need in ("training", "certificate", "tables") if _any(found, need)]
    print(f"from {first} to {second}: {', '.join(needs)} anew")


def _any(found: list[Any], need: str) -> bool:
    return any(need in one.needs for one in found)


@with_subcommands(new, check, show, diff)
def preset() -> None:
    """Write, check, show and compare presets: cell, limits and sensors in one TOML file (SI units).

    Example: bms preset new my_cell --out my_cell.toml
    """


def _verdict(path: Path, number: int) -> str:
    if number:
        return f"{path}: {number} {'thing' if number == 1 else 'things'} to mend"
    return (
        f"{path}: can be used; next: 'bms train --preset {shlex.quote(str(path))} --out "
        "model.json', then 'bms verify', which tries what no single key shows"
    )


def _unit(key: str) -> str:
    told = explanation(key)
    return "" if told is None or told.unit in {"1", "text", "of the channel"} else told.unit


def _text(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        if len(value) > _LONGEST_LIST and not isinstance(value[0], (list, str)):
            return f"{len(value)} values, {_text(value[0])} to {_text(value[-1])}"
        return ", ".join(
            f"[{_text(one)}]" if isinstance(one, list) else _text(one) for one in value
        )
    if isinstance(value, dict):
        return ", ".join(f"{name} {_text(one)}" for name, one in value.items())
    return "" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
