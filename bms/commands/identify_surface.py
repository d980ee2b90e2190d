"""`bms identify` on recordings of a cycler: a preset of a family without a measured core."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import typer
from rich.console import Console

from bms.arrays import Array
from bms.cli import EXIT_DONE
from bms.commands.surface_options import SurfaceOptions
from bms.data.cycler import CyclerRecording, read_cycler, write_own_columns
from bms.data.cycler_text import read_table
from bms.errors import InputError
from bms.files import write_text
from bms.identification.cell_identification import PARTS, IdentifiedCell, identify_cell
from bms.identification.cell_preset import CellPreset, cell_preset
from bms.identification.fit_report import write_report
from bms.identification.geometry import Shape, shape, shape_of_capacity
from bms.identification.preset_check import PresetCheck, check_preset
from bms.identification.preset_toml import preset_toml
from bms.identification.rated import parse_rated, rated_limits
from bms.identification.surface_thermal import ENTROPY_SOC
from bms.text_table import TextTable
from bms.waiting import waiting


def has_measured_core(path: Path) -> bool:
    """Whether the file's header names the core's temperature as the project does."""
    try:
        return "core_temperature_K" in read_table(path).header
    except InputError:
        # The reader of recordings with a core has the better words for what is wrong.
        return True


def identify_surface(
    files: Sequence[Path], chosen: SurfaceOptions, out: Path | None, *, as_json: bool
) -> int:
    """Read, fit, write the preset, check it; InputError in one line for whatever is wrong."""
    if out is not None and out.suffix != ".toml":
        raise InputError(f"--out {out}: a preset is a file with the ending .toml; change the name")
    form, given = chosen.form, parse_rated(chosen.rated)
    recordings = [read_cycler(path, form) for path in files]
    unused = None if chosen.check is None else read_cycler(chosen.check, form)
    if chosen.save_as is not None:
        _save(recordings, chosen.save_as)
    if out is None and chosen.save_as is not None and chosen.check is None:
        return EXIT_DONE
    limits = rated_limits(given, recordings)
    own_shape = _shape(chosen.geometry, recordings)
    entropic = None if chosen.entropy is None else _entropic(chosen.entropy)
    with waiting("aligning", total=float(PARTS), unit="parts") as wait:
        cell = identify_cell(recordings, own_shape, entropic, wait.begin)
    literature = {} if chosen.entropy is None else {"entropy": f"given: {chosen.entropy.name}"}
    found = cell_preset(cell, limits, out.stem if out else "identified", literature)
    if out is not None:
        write_text(out, preset_toml(found.preset, found.notes))
    checked = None if unused is None else check_preset(found.preset, unused)
    if chosen.report is not None:
        write_report(cell, found, unused, checked, chosen.report)
    if as_json:
        typer.echo(json.dumps(_content(cell, found, checked), indent=1))
    else:
        _print(cell, found, checked)
    for key, source in limits.sources.items():
        if source.startswith("not given"):
            typer.echo(f"bms: {key}: {source}", err=True)
    if chosen.geometry is None:
        typer.echo(
            "bms: --geometry not given: the core's resistance is that of a cylinder of the cell's "
            "charge, with a wide interval",
            err=True,
        )
    return EXIT_DONE


def _save(recordings: Sequence[CyclerRecording], path: Path) -> None:
    if len(recordings) == 1:
        write_own_columns(recordings[0], path)
        return
    for number, recording in enumerate(recordings, start=1):
        write_own_columns(recording, path.with_name(f"{path.stem}_{number}{path.suffix}"))


def _shape(geometry: str | None, recordings: Sequence[CyclerRecording]) -> Shape:
    if geometry is not None:
        return shape(geometry)
    most_As = max(float(np.ptp(recording.charge_out_As)) for recording in recordings)
    voltage_V = float(np.median(recordings[0].voltage_V))
    return shape_of_capacity(most_As / 3600.0 * voltage_V)


def _entropic(path: Path) -> Array:
    table = read_table(path)
    pairs = np.array([[table.number(row, place) for place in (0, 1)] for row in table.rows])
    if not np.all(np.isfinite(pairs)) or np.any(np.diff(pairs[:, 0]) <= 0.0):
        raise InputError(f"{path}: needs two columns, soc rising from 0 to 1 and V_per_K")
    if np.max(np.abs(pairs[:, 1])) > 0.01 or not -0.01 <= pairs[0, 0] <= pairs[-1, 0] <= 1.01:
        raise InputError(f"{path}: soc from 0 to 1 and dU/dT in V/K; likely mV/K or percent")
    return np.asarray(np.interp(ENTROPY_SOC, pairs[:, 0], pairs[:, 1]))


def _content(
    cell: IdentifiedCell, found: CellPreset, checked: PresetCheck | None
) -> dict[str, object]:
    return {
        "capacity_Ah": cell.alignment.capacity_Ah,
        "reference": cell.alignment.reference,
        "voltage_rmse_V": {
            one.name: rmse for one, rmse in zip(cell.recordings, cell.electrical.rmse_V)
        },
        "surface_rmse_K": dict(zip(cell.thermal_names, cell.thermal[0].rmse_K)),
        "sources": found.notes,
        "check": None if checked is None else asdict(checked),
    }


def _print(cell: IdentifiedCell, found: CellPreset, checked: PresetCheck | None) -> None:
    console = Console()
    surface = dict(zip(cell.thermal_names, cell.thermal[0].rmse_K))
    table = TextTable("recording", "rows", "SoC", "cell", "voltage RMSE mV", "surface RMSE K")
    for one, soc, specimen, rmse_V in zip(
        cell.recordings, cell.alignment.soc, cell.alignment.specimens, cell.electrical.rmse_V
    ):
        rmse_K = surface.get(one.name)
        table.add_row(
            one.name,
            str(len(one.time_s)),
            f"{soc.max():.2f} to {soc.min():.2f}",
            "described" if specimen == 0 else f"other {specimen}",
            f"{1e3 * rmse_V:.1f}",
            "" if rmse_K is None else f"{rmse_K:.2f}",
        )
    table.print(console)
    own, interval = found.preset.cell, found.preset.cell.interval
    assert interval is not None
    table = TextTable("parameter", "value", "family", "source")
    for name, unit, factors in (
        ("capacity", "Ah", interval.capacity),
        ("core_resistance", "K_per_W", interval.core_resistance),
        ("core_heat_capacity", "J_per_K", interval.core_heat_capacity),
        ("surface_resistance", "K_per_W", interval.surface_resistance),
        ("surface_heat_capacity", "J_per_K", interval.surface_heat_capacity),
        ("ohmic_resistance", "ohm", interval.resistance),
    ):
        key = f"{name}_{unit}"
        value = getattr(own, key)
        table.add_row(
            key,
            f"{value:.4g}",
            f"{value * factors[0]:.3g} to {value * factors[1]:.3g}",
            found.notes.get(f"cell.{key}", ""),
        )
    table.print(console)
    if checked is not None:
        console.print(checked.line, markup=False, highlight=False, soft_wrap=True)
