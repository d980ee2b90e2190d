"""`bms identify`: cell parameters from measured temperatures."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.commands import options, surface_options
from bms.commands.identify_surface import has_measured_core, identify_surface
from bms.data.datasets import training_rows
from bms.data.measurements import Measurements, read_measurements, read_voltage
from bms.errors import InputError
from bms.files import write_text
from bms.identification import Identification, NotIdentifiedError
from bms.identification import identify as identified
from bms.identification.disturbance import ACCURACY_K
from bms.identification.disturbance_bound import QUANTILES, STRETCHES
from bms.identification.needed import (
    Needed,
    NeededUncertainty,
    needed_uncertainty,
    source_of_core,
    stated,
)
from bms.identification.preset_toml import preset_toml
from bms.presets import Preset, load_preset
from bms.text_table import TextTable
from bms.waiting import waiting

_DIGITS = 6


def identify(
    data: Annotated[
        list[Path] | None,
        typer.Option(
            "--data",
            help=f"{options.DATA_HELP} Or, without a measured core, recordings of a cycler, CSV "
            "or TXT. May be repeated; further files may follow it.",
        ),
    ] = None,
    more: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILE]...", help="Further recordings.")
    ] = None,
    preset: Annotated[
        str,
        options.preset_option(
            "Preset to start from, and for what the data do not identify, with a measured core"
        ),
    ] = "lin2014",
    out: Annotated[
        Path | None, typer.Option("--out", help="Preset with the fitted cell to write (.toml).")
    ] = None,
    accuracy_K: Annotated[
        float,
        typer.Option(
            "--accuracy",
            min=0.001,
            max=10.0,
            help="RMS in K within which the model follows the temperatures with its disturbance.",
        ),
    ] = ACCURACY_K,
    columns: surface_options.ColumnsOption = None,
    temperature_unit: surface_options.TemperatureUnitOption = "K",
    charge_is_positive: surface_options.ChargeSignOption = False,
    sample_period_s: surface_options.SamplePeriodOption = None,
    geometry: surface_options.GeometryOption = None,
    rated: surface_options.RatedOption = None,
    entropy: surface_options.EntropyOption = None,
    check: surface_options.CheckOption = None,
    save_as: surface_options.SaveAsOption = None,
    report: surface_options.ReportOption = None,
    as_json: options.JsonOption = False,
) -> int:
    """Fit a cell to recordings: its thermal part with a measured core, all of it without one.

    With a measured core (column core_temperature_K), the thermal parameters. The first two thirds
    of the recording are fitted, the last third is simulated on and compared.
    Temperatures fix ratios only: the core's heat capacity (J/K) is the preset's and sets the scale.
    A parameter that the data do not tell, or only at the bound of the search, is named with the
    reason; then no preset is written and the exit code is 1.

    The disturbance is the smoothest with which the fitted model follows all of the recording. Its
    bound grows with the current, covers 99.9 % of the rows, and is multiplied until it does so in
    each of 19 stretches; the preset states it. With a column voltage_V (V) the core's is found with
    the measured heat too, which is what a preset with cell.interval states.

    Without one, from one or more recordings of a cycler, a whole preset of a family: open-circuit
    voltage and capacity, resistances, heat capacity, cooling, dU/dT, with intervals; limits are
    those of --rated, else what the recordings have shown. Every number's source stands beside it.

    Example: bms identify --data cycle.csv --preset lin2014 --out my_cell.toml
    """
    files = [*(data or []), *(more or [])]
    if not files:
        raise InputError("identify: give --data FILE")
    chosen = surface_options.SurfaceOptions(
        tuple(columns or ()),
        temperature_unit,
        charge_is_positive,
        sample_period_s,
        geometry or None,
        tuple(rated or ()),
        entropy,
        check,
        save_as,
        report,
    )
    if chosen.is_given or len(files) > 1 or not has_measured_core(files[0]):
        return identify_surface(files, chosen, out, as_json=as_json)
    return _identify_measured(files[0], preset, out, accuracy_K, as_json=as_json)


def _identify_measured(
    data: Path, preset: str, out: Path | None, accuracy_K: float, *, as_json: bool
) -> int:
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
    needed = None
    if not result.not_identified:
        with waiting("bounding the disturbance"):
            needed = _needed(result, start, recording, data, accuracy_K)
        if out is not None:
            write_text(out, preset_toml(_preset(start, result, needed, out.stem, data.name)))
    if as_json:
        content = _content(result) | {"disturbance": None if needed is None else _told(needed)}
        typer.echo(json.dumps(content, indent=1))
    else:
        _print(result, data)
        if needed is not None:
            _print_disturbance(needed, is_family=start.cell.interval is not None)
    _tell(result.not_identified)
    return EXIT_CHECK_FAILED if result.not_identified else EXIT_DONE


def _tell(reasons: Mapping[str, str]) -> None:
    for name, reason in reasons.items():
        typer.echo(f"bms: {name}: not identified: {reason}", err=True)


def _needed(
    result: Identification, start: Preset, recording: Measurements, data: Path, accuracy_K: float
) -> NeededUncertainty:
    cell = dataclasses.replace(start.cell, **_fitted(result))
    return needed_uncertainty(cell, recording, read_voltage(data), accuracy_K)


def _fitted(result: Identification) -> dict[str, Any]:
    return {
        parameter: float(f"{getattr(result.cell, parameter):.{_DIGITS}g}")
        for parameter in result.correlated
    }


def _preset(
    start: Preset, result: Identification, needed: NeededUncertainty, name: str, data: str
) -> Preset:
    fitted, is_family = _fitted(result), start.cell.interval is not None
    return dataclasses.replace(
        start,
        name=name,
        description=f"Preset {start.name} with thermal parameters identified from {data}",
        sources=(
            f"{', '.join(fitted)}: identified from {data} by bms identify",
            f"uncertainty ({source_of_core(needed, is_family=is_family)}): what the model needs to "
            f"follow {data} within {needed.accuracy_K:g} K RMS, by bms identify",
            *(f"preset {start.name}: {source}" for source in start.sources),
        ),
        cell=dataclasses.replace(start.cell, **fitted),
        uncertainty=stated(start.uncertainty, needed, is_family=is_family),
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
    table = TextTable("parameter", "value", "standard error", "preset", "remark")
    for parameter in result.parameters:
        error = parameter.standard_error
        table.add_row(
            parameter.name,
            f"{parameter.value:.5g}",
            "" if error is None else f"{error:.2g}",
            f"{parameter.start:.5g}",
            parameter.remark,
        )
    table.print(console)
    table = TextTable("rows", "number", "core RMSE K", "surface RMSE K", title=str(data))
    for name, residuals in (("fitted", result.fitted), ("held out", result.held_out)):
        if residuals is not None:
            table.add_row(
                name,
                str(residuals.rows),
                f"{residuals.core_rmse_K:.4f}",
                f"{residuals.surface_rmse_K:.4f}",
            )
    table.print(console)
    console.print(f"{result.starts_at_minimum} of {result.starts} starts ended in this minimum")
    if (strongest := result.strongest_correlation) is not None:
        one, other, value = strongest
        console.print(f"strongest correlation: {value:+.2f} between {one} and {other}")


def _told(needed: NeededUncertainty) -> dict[str, Any]:
    return {
        "accuracy_K": needed.accuracy_K,
        "quantiles": QUANTILES,
        "needed": {
            name: dataclasses.asdict(one.bound)
            | {
                "conformal": dataclasses.asdict(one.bound.conformal),
                "error_rms_K": one.missing.error_rms_K,
                "error_K": one.missing.error_K,
                "time_scale_s": one.missing.time_scale_s,
            }
            for name, one in needed.disturbances.items()
        },
        "untold": dict(needed.untold),
    }


def _print_disturbance(needed: NeededUncertainty, *, is_family: bool) -> None:
    console = Console()
    names = list(needed.disturbances)
    table = TextTable(
        "", *names, title="disturbance that the fitted model needs, in K/s, over all rows"
    )
    for heading, *cells in zip(*(_column(needed.disturbances[name]) for name in names)):
        table.add_row(heading[0], *(cell[1] for cell in (heading, *cells)))
    table.print(console)
    for name, reason in needed.untold.items():
        console.print(f"{name}: not told: {reason}", markup=False)
    console.print(
        f"'others cover': share of each of {STRETCHES} stretches under the bound of the others"
    )
    console.print(
        f"a preset states n0, n1, n2 of '{source_of_core(needed, is_family=is_family)}' and of the "
        "others, each times its factor"
    )


def _column(needed: Needed) -> Iterator[tuple[str, str]]:
    """Headings and values of one disturbance."""
    bound, missing = needed.bound, needed.missing
    for share, value in zip(QUANTILES, bound.quantiles_K_per_s):
        yield f"{100 * share:g} % below", f"{value:.1e}"
    yield "n0", f"{bound.fitted.constant_K_per_s:.1e}"
    yield "n1 /A", f"{bound.fitted.per_A_K_per_As:.1e}"
    yield "n2 /A2", f"{bound.fitted.per_A2_K_per_A2s:.1e}"
    yield "others cover, mean %", f"{100 * sum(bound.coverage) / STRETCHES:.1f}"
    yield "  least %", f"{100 * min(bound.coverage):.1f}"
    yield "factor to cover each", f"{bound.factor:.2f}"
    yield "followed, K RMS", f"{missing.error_rms_K:.3f}"
    yield "  99.9 % within, K", f"{missing.error_K:.3f}"
    yield "averaged over, s", f"{missing.time_scale_s:.1f}"
