"""Picture of the instructions over a charge."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bms.drawing import new_figure
from bms.files import png
from hil_sim.report.chart import CHART_DPI
from hil_sim.studies.cost.measure import CostReport

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PANELS = (
    {"control_period": ("whole control period", "C0")},
    {
        "estimate_and_decision": ("estimate and decision", "C3"),
        "estimate": ("estimate", "C2"),
        "decision": ("decision", "C1"),
    },
)
_HEADROOM = 1.35
"""Of the highest line, so that the legend has a place of its own."""


def cost_chart(reports: Sequence[CostReport], period_s: float) -> bytes:
    """PNG with a row of panels for each board, instructions over time."""
    figure = new_figure(10.0, 3.4 * len(reports))
    panels = figure.subplots(len(reports), len(_PANELS), squeeze=False, sharex=True)
    for report, row in zip(reports, panels):
        for axes, lines in zip(row, _PANELS):
            _draw(axes, report, lines, period_s)
        row[0].set_ylabel("instructions")
    for axes in panels[-1]:
        axes.set_xlabel("time since the ECU's first decision (s)")
    return png(figure, CHART_DPI)


def _draw(
    axes: Axes, report: CostReport, lines: dict[str, tuple[str, str]], period_s: float
) -> None:
    for kind, (label, color) in lines.items():
        counts, worst = report.series[kind][report.charging], report.costs[kind].worst
        axes.plot(np.arange(len(counts)) * period_s, counts, color=color, linewidth=0.8)
        axes.axhline(worst, color=color, linestyle=":", label=f"{label}, worst found {worst}")
    axes.set_ylim(0, _HEADROOM * max(report.costs[kind].worst for kind in lines))
    axes.set_title(report.board, loc="left", fontsize="medium")
    axes.grid(True, alpha=0.25)
    axes.legend(fontsize="small", loc="upper right")
