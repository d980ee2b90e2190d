"""Picture of the comparison: time over physics' bound of every controller from every start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bms.drawing import new_figure
from bms.files import png
from hil_sim.report.chart import CONTROLLER_COLOURS, LIMIT_COLOUR
from hil_sim.studies.charge_times.tables import crossed_limits, start_text

_MARKERS = "osD^v<>P"
_COLOURS = (*CONTROLLER_COLOURS, "#000000")
_DPI = 130
_WIDEST = 2.5
"""Ratios beyond it stand at the edge."""


def comparison_chart(content: Mapping[str, Any]) -> bytes:
    """PNG with a row a start; an open mark stands for a charge that crossed a limit."""
    rows = content["starts"]
    figure = new_figure(9.0, 2.0 + 0.28 * len(rows))
    axes = figure.subplots()
    for number, (name, figures) in enumerate(content["controllers"].items()):
        colour, marker = _COLOURS[number % len(_COLOURS)], _MARKERS[number % len(_MARKERS)]
        for is_kept, fill in ((True, colour), (False, "none")):
            points = [
                (min(charge["over_optimum_time_s"], _WIDEST), place)
                for place, row in enumerate(rows)
                for charge in row["charges"]
                if charge["controller"] == name
                and charge["over_optimum_time_s"] is not None
                and (not crossed_limits(charge)) is is_kept
            ]
            if points:
                axes.plot(
                    *zip(*points), ls="", marker=marker, color=colour, markerfacecolor=fill, ms=5
                )
        axes.plot([], [], ls="", marker=marker, color=colour, label=figures["title"])
    axes.axvline(1.0, color=LIMIT_COLOUR, lw=1.1, label="physics' bound")
    axes.set_yticks(range(len(rows)), [start_text(row) for row in rows], fontsize=7)
    axes.invert_yaxis()
    axes.set_xlim(right=_WIDEST + 0.05)
    axes.set_xlabel("time to full over physics' bound (–); open: a limit was crossed")
    axes.grid(axis="x", alpha=0.3)
    figure.legend(loc="outside lower center", ncols=3, fontsize=8)
    return png(figure, _DPI)
