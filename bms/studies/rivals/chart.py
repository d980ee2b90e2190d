"""Error against cost of all estimators, and how the error runs along one profile."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bms.arrays import Array
from bms.drawing import new_figure
from bms.files import png, write_bytes
from bms.studies.rivals.comparison import Comparison, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

_MARKERS = "osD^vP*Xh<>"
_MARKS = 12
_WINDOW_S = 60.0
_SMALLEST_SHOWN_K = 1e-4


def save_chart(comparison: Comparison, path: Path) -> None:
    """Write the PNG; InputError when that cannot be done."""
    figure = new_figure(13, 6.4)
    cost, trace = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    colours = cycle(f"C{place}" for place in range(10))
    for row, colour, marker in zip(comparison.rows, colours, cycle(_MARKERS)):
        if row.cost is not None:
            _draw(row, comparison, cost, trace, colour, marker)
        elif row.errors:
            cost.axhline(row.rmse_K, color="black", linestyle="--", linewidth=1, label=row.name)
    _label(cost, trace, comparison)
    figure.legend(*cost.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.suptitle(comparison.title)
    write_bytes(path, png(figure, 110))


def _draw(
    row: Row,
    comparison: Comparison,
    cost: Axes,
    trace: Axes,
    colour: str,
    marker: str,
) -> None:
    assert row.cost is not None
    cost.plot(
        row.cost.multiply_adds,
        row.rmse_K,
        marker,
        color=colour,
        markersize=9,
        linestyle="none",
        label=row.name,
    )
    time_s = comparison.trace.time_s
    running_K = _running_rms_K(comparison.trace.error_K[row.name], time_s)
    trace.plot(
        time_s,
        running_K,
        color=colour,
        linewidth=1.2,
        marker=marker,
        markevery=max(1, len(time_s) // _MARKS),
        markersize=5,
    )


def _running_rms_K(error_K: Array, time_s: Array) -> Array:
    """Root mean square of the errors (N,) in the minute before each time."""
    first = np.searchsorted(time_s, time_s - _WINDOW_S, side="right")
    sums = np.concatenate([[0.0], np.cumsum(error_K**2)])
    last = np.arange(1, len(error_K) + 1)
    mean = np.maximum(sums[last] - sums[first], 0.0) / (last - first)
    running_K: Array = np.sqrt(mean)
    return np.maximum(running_K, _SMALLEST_SHOWN_K)


def _label(cost: Axes, trace: Axes, comparison: Comparison) -> None:
    cost.set_xscale("log")
    cost.margins(x=0.1, y=0.1)
    _label_decades(cost.xaxis)
    cost.set_xlabel("multiply-adds per estimate")
    cost.set_ylabel("RMSE in K")
    cost.set_title("error and cost, both better to the lower left", fontsize=10)
    trace.set_xlabel("time in s")
    trace.set_ylabel(f"RMS error of the last {_WINDOW_S:g} s in K")
    trace.set_title(comparison.trace.title, fontsize=10)
    for axis in (cost, trace):
        axis.set_yscale("log")
        _label_decades(axis.yaxis)
        axis.grid(alpha=0.3)


def _label_decades(axis: Axis) -> None:
    from matplotlib.ticker import LogLocator  # noqa: PLC0415 -- as in bms.drawing

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")
