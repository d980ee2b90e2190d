"""A page with an identified cell: its fits, its intervals, and what each number rests on."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bms.arrays import Array
from bms.data.cycler import CyclerRecording
from bms.drawing import new_figure
from bms.files import make_folder, png, write_bytes, write_text
from bms.identification.cell_identification import (
    IdentifiedCell,
    electrical_records,
    thermal_record,
)
from bms.identification.cell_preset import CellPreset
from bms.identification.electrical import RESISTANCE_SOC, growth, voltage_V
from bms.identification.preset_check import PresetCheck, predict
from bms.identification.surface_thermal import ENTROPY_SOC, heat_W, temperatures_K
from bms.presets import Preset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "identification.html"
_DPI = 110
_STYLE = (
    "body{font-family:sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem}"
    "table{border-collapse:collapse}td,th{border:1px solid #bbb;padding:.2rem .5rem;"
    "text-align:left;vertical-align:top}img{max-width:100%}"
)


def write_report(
    cell: IdentifiedCell,
    found: CellPreset,
    unused: CyclerRecording | None,
    checked: PresetCheck | None,
    folder: Path,
) -> None:
    """Write the page and its pictures into a folder; InputError when that cannot be done."""
    make_folder(folder)
    pictures = {"electrical.png": _electrical(cell), "thermal.png": _thermal(cell)}
    if unused is not None:
        pictures["check.png"] = _check(found.preset, unused)
    for name, figure in pictures.items():
        write_bytes(folder / name, png(figure, _DPI))
    rows = [(key, _plain(found.preset, key), note) for key, note in found.notes.items()]
    parts = [
        f"<h1>{html.escape(found.preset.name)}</h1>",
        f"<p>{html.escape(found.preset.description)}</p>",
        _table(("recording", "rows", "state of charge", "voltage RMSE mV"), _recordings(cell)),
        "" if checked is None else f'<p>{html.escape(checked.line)}</p><img src="check.png">',
        '<h2>Voltage</h2><img src="electrical.png">',
        '<h2>Temperature</h2><img src="thermal.png">',
        "<h2>What each number rests on</h2>",
        _table(("key", "value", "source"), rows),
    ]
    write_text(
        folder / PAGE,
        f'<!doctype html><meta charset="utf-8"><title>{html.escape(found.preset.name)}</title>'
        f"<style>{_STYLE}</style>" + "\n".join(parts) + "\n",
    )


def _recordings(cell: IdentifiedCell) -> list[tuple[str, ...]]:
    return [
        (one.name, str(len(one.time_s)), f"{soc.max():.2f} to {soc.min():.2f}", f"{1e3 * rmse:.1f}")
        for one, soc, rmse in zip(cell.recordings, cell.alignment.soc, cell.electrical.rmse_V)
    ]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"

    return "<table>" + line(head, "th") + "".join(line(row, "td") for row in rows) + "</table>"


def _plain(preset: Preset, key: str) -> str:
    value: object = preset
    for name in key.split("."):
        value = getattr(value, name, "")
    return str(value) if isinstance(value, (int, float)) else ""


def _electrical(cell: IdentifiedCell) -> Figure:
    figure = new_figure(9.0, 10.0)
    voltage, error, ocv, ohm = figure.subplots(4, 1)
    records = electrical_records(cell.recordings, cell.alignment, cell.core_K)
    for number, record in enumerate(records):
        fitted_V = voltage_V(cell.electrical, record)
        voltage.plot(record.soc, record.voltage_V, color=f"C{number}", label=record.name)
        voltage.plot(record.soc, fitted_V, "--", color="0.3", linewidth=0.7)
        error.plot(record.soc, 1e3 * (fitted_V - record.voltage_V), color=f"C{number}", lw=0.7)
    ocv.plot(cell.electrical.ocv.soc, cell.electrical.ocv.voltage_V, ".-")
    for temperature_K in (273.15, 298.15, 318.15):
        factor = growth(cell.electrical.activation_K, np.array(temperature_K))
        ohm.plot(
            RESISTANCE_SOC,
            1e3 * np.array(cell.electrical.ohm) * factor,
            label=f"{temperature_K:.0f} K",
        )
    for axes, text in (
        (voltage, "voltage (V), fit dashed"),
        (error, "fit less measured (mV)"),
        (ocv, "open-circuit voltage (V)"),
        (ohm, "ohmic resistance (mohm)"),
    ):
        axes.set_ylabel(text)
        axes.grid(True, alpha=0.3)
    ohm.set_xlabel("state of charge")
    voltage.legend(fontsize="x-small")
    ohm.legend(fontsize="x-small")
    return figure


def _thermal(cell: IdentifiedCell) -> Figure:
    figure = new_figure(9.0, 6.0)
    surface, entropy = figure.subplots(2, 1)
    fit = cell.thermal[0]
    for number, (recording, soc) in enumerate(zip(cell.recordings, cell.alignment.soc)):
        if recording.name not in cell.thermal_names:
            continue
        irreversible_W: Array = recording.current_A * (
            cell.electrical.ocv(soc) - recording.voltage_V
        )
        record = thermal_record(recording, soc, irreversible_W)
        core_K, fitted_K = temperatures_K(fit, record, heat_W(record, fit.entropic_V_per_K))
        surface.plot(record.time_s, record.surface_K, color=f"C{number}", label=record.name)
        surface.plot(record.time_s, fitted_K, "--", color="0.3", linewidth=0.8)
        surface.plot(record.time_s, core_K, ":", color=f"C{number}", linewidth=0.8)
    surface.set_ylabel("surface (K), fit dashed, core dotted")
    surface.set_xlabel("time (s)")
    surface.grid(True, alpha=0.3)
    if cell.thermal_names:
        surface.legend(fontsize="x-small")
    entropy.plot(ENTROPY_SOC, 1e3 * fit.entropic_V_per_K, ".-")
    entropy.set_ylabel("dU/dT (mV/K)")
    entropy.set_xlabel("state of charge")
    entropy.grid(True, alpha=0.3)
    return figure


def _check(preset: Preset, unused: CyclerRecording) -> Figure:
    found = predict(preset, unused)
    figure = new_figure(9.0, 6.0)
    voltage, surface = figure.subplots(2, 1, sharex=True)
    voltage.fill_between(unused.time_s, found.low_V, found.high_V, alpha=0.2, label="family")
    voltage.plot(unused.time_s, found.voltage_V, "--", label="nominal cell")
    voltage.plot(unused.time_s, unused.voltage_V, label=unused.name)
    voltage.set_ylabel("voltage (V)")
    voltage.legend(fontsize="x-small")
    surface.fill_between(unused.time_s, found.coldest_K, found.warmest_K, alpha=0.2)
    surface.plot(unused.time_s, found.surface_K, "--")
    if unused.surface_K is not None:
        surface.plot(unused.time_s, unused.surface_K)
    surface.set_ylabel("surface (K)")
    surface.set_xlabel("time (s)")
    return figure
