"""`bms identify`: cell parameters from measured temperatures."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands import options
from bms.data.datasets import training_rows
from bms.data.measurements import read_measurements
from bms.errors import InputError
from bms.files import write_text
from bms.identification import Identification, NotIdentifiedError
from bms.identification import identify as identified
from bms.identification.preset_toml import preset_toml
from bms.presets import Preset, load_preset
from bms.waiting import waiting

_DIGITS = 6


def identify(
    data: options.DataOption,
    preset: Annotated[
        str,
        options.preset_option("Preset to start from, and for what the data do not identify"),
    ] = "lin2014",
    out: Annotated[
        Path | None, typer.Option("--out", help="Preset with the fitted cell to write (.toml).")
    ] = None,
    as_json: options.JsonOption = False,
) -> int:
    """Fit a cell's thermal parameters to measured core and surface temperature (K).

    The first two thirds of the recording are fitted, the last third is simulated on and compared.
    Temperatures fix ratios only: the core's heat capacity (J/K) is the preset's and sets the scale.
    A parameter that the data do not tell, or only at the bound of the search, is named with the
    reason; then no preset is written and the exit code is 1.

    Example: bms identify --data cycle.csv --preset lin2014 --out my_cell.toml
    """
    if data is None:
        raise InputError("identify: give --data CSV")
    if out is not None and out.suffix != ".toml":
        raise InputError(f"--out {out}: a preset is a file with the ending .toml; change the name")
    start = load_preset(preset)
    recording = read_measurements(data, core_may_be_copied=True)
    cut = training_rows(len(recording.time_s))
    try:
        with waiting("fitting from several starts") as wait:
            result = identified(recording, start, slice(0, cut), wait.reach)
    except NotIdentifiedError as error:
        _tell(error.reasons)
        return EXIT_CHECK_FAILED
    except InputError as error:
        raise InputError(f"{data}: {error}") from None
    if out is not None and not result.not_identified:
        write_text(out, preset_toml(_preset(start, result, out.stem, data.name)))
    if as_json:
        typer.echo(json.dumps(_content(result), indent=1))
    else:
        _print(result, data)
    _tell(result.not_identified)
    return EXIT_CHECK_FAILED if result.not_identified else EXIT_DONE


def _tell(reasons: Mapping[str, str]) -> None:
    for name, reason in reasons.items():
        typer.echo(f"bms: {name}: not identified: {reason}", err=True)


def _preset(start: Preset, result: Identification, name: str, data: str) -> Preset:
    fitted: dict[str, Any] = {
        parameter: float(f"{getattr(result.cell, parameter):.{_DIGITS}g}")
        for parameter in result.correlated
    }
    return dataclasses.replace(
        start,
        name=name,
        description=f"Preset {start.name} with thermal parameters identified from {data}",
        sources=(
            f"{', '.join(fitted)}: identified from {data} by bms identify",
            *(f"preset {start.name}: {source}" for source in start.sources),
        ),
        cell=dataclasses.replace(start.cell, **fitted),
    )


def _content(result: Identification) -> dict[str, Any]:
    return {
        "parameters": {
            parameter.name: {
                key: value for key, value in dataclasses.asdict(parameter).items() if key != "name"
            }
            for parameter in result.parameters
        },
        "fitted": dataclasses.asdict(result.fitted),
        "held_out": None if result.held_out is None else dataclasses.asdict(result.held_out),
        "correlation": {
            one: dict(zip(result.correlated, row))
            for one, row in zip(result.correlated, result.correlation.tolist())
        },
        "not_identified": dict(result.not_identified),
        "starts": result.starts,
        "starts_at_minimum": result.starts_at_minimum,
    }


def _print(result: Identification, data: Path) -> None:
    console = Console()
    table = Table()
    for heading in ("parameter", "value", "standard error", "preset", "remark"):
        table.add_column(heading, no_wrap=heading == "parameter")
    for parameter in result.parameters:
        error = parameter.standard_error
        table.add_row(
            parameter.name,
            f"{parameter.value:.5g}",
            "" if error is None else f"{error:.2g}",
            f"{parameter.start:.5g}",
            parameter.remark,
        )
    console.print(table)
    table = Table("rows", "number", "core RMSE K", "surface RMSE K", title=escape(str(data)))
    for name, residuals in (("fitted", result.fitted), ("held out", result.held_out)):
        if residuals is not None:
            table.add_row(
                name,
                str(residuals.rows),
                f"{residuals.core_rmse_K:.4f}",
                f"{residuals.surface_rmse_K:.4f}",
            )
    console.print(table)
    console.print(f"{result.starts_at_minimum} of {result.starts} starts ended in this minimum")
    if (strongest := result.strongest_correlation) is not None:
        one, other, value = strongest
        console.print(f"strongest correlation: {value:+.2f} between {one} and {other}")
