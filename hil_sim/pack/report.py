"""Files of a pack's charge: summary.json, pack.png with a heat map of cells over time, a page."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from bms.drawing import new_figure
from bms.files import png
from hil_sim.pack.charge import PackResult
from hil_sim.pack.summary import KINDS, has_passed, summary
from hil_sim.report.folder import OutputFolder
from hil_sim.report.page import data_url, render_page

_DPI = 130


def heat_map(result: PackResult) -> bytes:
    """PNG: core temperature of every cell over time, the current, and who governs."""
    settings = result.settings
    limits = settings.preset.limits
    figure = new_figure(9.0, 7.5)
    current, cores = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 2.6))
    times = np.array(result.sample_s)
    current.plot(times, result.current_A, color="#0072B2")
    current.axhline(limits.reference_current_A, color="#7A1F5C", linestyle=":")
    current.set_ylabel("Current\n(A)")
    values = np.array(result.core_K).T
    edges = np.arange(settings.cells + 1) + 0.5
    step_s = times[1] - times[0] if len(times) > 1 else 1.0
    picture = cores.pcolormesh(
        np.append(times, times[-1] + step_s), edges, values, cmap="inferno", rasterized=True,
        vmax=limits.max_core_temperature_K,
    )  # fmt: skip
    governor = np.array(result.governor, dtype=float)
    governor[governor == 0.0] = np.nan
    cores.plot(times, governor, ".", color="#56B4E9", markersize=3.0, label="governs")
    cores.set_ylabel("Cell")
    cores.set_xlabel("Time since the request (s)")
    cores.set_ylim(0.5, settings.cells + 0.5)
    if np.isfinite(governor).any():
        cores.legend(loc="upper left")
    bar = figure.colorbar(picture, ax=cores)
    bar.set_label(f"True core temperature (K), limit {limits.max_core_temperature_K:g} K")
    return png(figure, _DPI)


def write_pack_report(folder: OutputFolder, result: PackResult) -> None:
    """Write summary.json, pack.png and report.html."""
    content = summary(result)
    folder.path("summary.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    chart = heat_map(result)
    folder.path("pack.png").write_bytes(chart)
    folder.path("report.html").write_text(pack_page(result, content, chart), encoding="utf-8")


def pack_page(result: PackResult, content: dict[str, Any], chart: bytes) -> str:
    """The self-contained HTML page of a charge."""
    rows = sorted(content["worst_margins"], key=lambda row: row["core_temperature_K"])
    return render_page(
        "pack.html.j2",
        content=content,
        has_passed=has_passed(result),
        rows=rows,
        kinds=KINDS,
        chart=data_url(chart),
    )
