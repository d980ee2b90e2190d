"""`bms plating`: a current map from an electrochemical model's anode potential."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands.options import JsonOption, number_list
from bms.errors import InputError
from bms.files import write_text
from bms.text_table import TextTable
from bms.waiting import waiting
from hil_sim.plant.electrochemistry import MODELS, PARAMETER_SET, Electrochemistry
from hil_sim.studies.plating.current_map import Plating, derive_map, steps

_TEMPERATURES = "273.15,278.15,283.15,288.15,293.15,298.15,308.15,323.15"
_CHARGES = "0,0.1,0.2,0.4,0.6,0.8,0.9,1"
_MOST_POINTS = 8
_TOLERANCE_V = 1e-3
"""Of the check of a map: its steps of the state of charge are not those that it came from."""


def plating(
    parameter_set: Annotated[
        str, typer.Option("--set", help="PyBaMM's parameter set of the cell.")
    ] = PARAMETER_SET,
    model: Annotated[
        str, typer.Option("--physics", help=f"PyBaMM's model: {' or '.join(MODELS)}.")
    ] = "spme",
    temperatures: Annotated[
        str,
        typer.Option(
            "--temperatures",
            show_default=False,  # one long word, which a narrow terminal would cut
            help="Rows of the map: temperatures in K, up to 8. Default: 8 from 273.15 to 323.15.",
        ),
    ] = _TEMPERATURES,
    soc: Annotated[
        str,
        typer.Option(
            "--soc",
            show_default=False,
            help="Columns of the map: states of charge, up to 8. Default: 8 from 0 to 1.",
        ),
    ] = _CHARGES,
    most_A: Annotated[
        float,
        typer.Option(
            "--most", min=0.1, max=1000.0, help="Strongest current in A of the data sheet."
        ),
    ] = 10.0,
    margin_V: Annotated[
        float,
        typer.Option("--margin", min=-0.5, max=0.5, help="Least anode potential in V."),
    ] = 0.0,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File for the map as TOML, a section of a preset (.toml)."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Derive the strongest charging currents at which no lithium plates on the anode.

    Lithium plates where the potential of the negative electrode (V) against the electrolyte at the
    separator falls below 0. From the empty cell on, a charge takes the strongest current (A) that
    keeps the margin at each state of charge and temperature (K); the map is the largest one that
    stays below these currents everywhere between its points too. Then a charge at each of the
    temperatures follows the map; exit code 1 when one of them falls short of the margin by 1 mV.

    The result is as good as the model: a set is one cell, new, at one temperature throughout.

    Example: bms plating --set Prada2013 --most 10 --out map.toml
    """
    if model not in MODELS:
        raise InputError(f"--physics {model}: not known; take one of {', '.join(MODELS)}")
    if out is not None and out.suffix != ".toml":
        raise InputError(f"--out {out}: a map is a file with the ending .toml; change the name")
    axes = {
        "--temperatures": number_list("--temperatures", temperatures, float, _TEMPERATURES),
        "--soc": number_list("--soc", soc, float, _CHARGES),
    }
    for option, axis in axes.items():
        if len(axis) > _MOST_POINTS:
            raise InputError(f"{option}: {len(axis)} points; a map has at most {_MOST_POINTS}")
    temperatures_K, charges = axes.values()
    cell = Electrochemistry(model, 0.0, 298.15, 1.0, parameter_set=parameter_set)
    with waiting("charging", steps(temperatures_K), "charges") as wait:
        result = derive_map(cell, temperatures_K, charges, most_A, margin_V, wait.advance)
    origin = f"PyBaMM {model.upper()}, {parameter_set}, anode at {margin_V:g} V or more"
    text = _toml(result, origin)
    if out is not None:
        write_text(out, text)
    if as_json:
        typer.echo(json.dumps(dataclasses.asdict(result), indent=1))
    else:
        _print(result, origin, text)
    least_V = min(check.anode_potential_V for check in result.checks)
    return EXIT_DONE if least_V >= margin_V - _TOLERANCE_V else EXIT_CHECK_FAILED


def _toml(result: Plating, origin: str) -> str:
    rows = ",\n".join(f"  {list(row)}" for row in result.map.largest_A)
    return (
        f"# {origin}\n[current_map]\n"
        f"temperature_K = {list(result.map.temperature_K)}\nsoc = {list(result.map.soc)}\n"
        f"largest_A = [\n{rows},\n]\n"
    )


def _print(result: Plating, origin: str, text: str) -> None:
    console = Console()
    charges = (f"{charge:g}" for charge in result.map.soc)
    table = TextTable("K \\ SoC", *charges, title=f"strongest charging current in A: {origin}")
    for temperature_K, row in zip(result.map.temperature_K, result.map.largest_A):
        table.add_row(f"{temperature_K:g}", *(f"{value_A:.1f}" for value_A in row))
    table.print(console)
    worst = min(result.checks, key=lambda check: check.anode_potential_V)
    console.print(
        f"least anode potential of the charges at these currents: "
        f"{1e3 * worst.anode_potential_V:.1f} mV, at {worst.temperature_K:.1f} K and state of "
        f"charge {worst.soc:.2f}"
    )
    typer.echo(text, nl=False)
