"""How punctual a real-time run was, as rows of a table and as a histogram."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bms.drawing import new_figure
from bms.files import png
from hil_sim.nodes.punctuality import PlantWatch, TimeStatistics, Timing
from hil_sim.report.chart import CHART_DPI, CONTROLLER_COLOURS
from hil_sim.report.figures import Figure
from hil_sim.run.result import RunResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BINS = 60
_MS_PER_S = 1000.0


def timing_figures(results: Sequence[RunResult]) -> list[Figure]:
    """Rows of the table; none when no run was in real time."""
    timings = [result.summary.timing for result in results]
    known = next((timing for timing in timings if timing is not None), None)
    if known is None:
        return []
    row = partial(_row, timings)
    return [
        row("Measurements begin late: median", lambda timing: _ms(timing.lateness, "median_ms")),
        row("Measurements begin late: 99 %", lambda timing: _ms(timing.lateness, "p99_ms")),
        row(
            "Measurements begin late: largest",
            lambda timing: _ms(timing.lateness, "max_ms"),
            f"{known.deadline_ms:g} ms",
        ),
        row("Measurements begin late: jitter", lambda timing: _ms(timing.lateness, "jitter_ms")),
        row(
            "Deadlines missed",
            lambda timing: f"{timing.missed_deadlines} of {timing.periods}",
        ),
        row("Command after: median", lambda timing: _ms(timing.answer_latency, "median_ms")),
        row("Command after: 99 %", lambda timing: _ms(timing.answer_latency, "p99_ms")),
        row("Command after: largest", lambda timing: _ms(timing.answer_latency, "max_ms")),
        row("Command after: jitter", lambda timing: _ms(timing.answer_latency, "jitter_ms")),
        row(
            "Periods without a new command",
            lambda timing: f"{timing.periods_without_command}",
        ),
        row("Most of them in a row", lambda timing: f"{timing.longest_without_command_periods}"),
    ]


def _row(
    timings: Sequence[Timing | None], name: str, text: Callable[[Timing], str], limit: str = ""
) -> Figure:
    values = ["–" if timing is None else text(timing) for timing in timings]
    return Figure(name, values, limit, [None] * len(values))


def _ms(times: TimeStatistics | None, name: str) -> str:
    return "–" if times is None else f"{getattr(times, name):.2f} ms"


def timing_chart(watch: PlantWatch) -> bytes:
    """PNG with histograms of lateness and of the time to the command; counts on a log scale."""
    figure = new_figure(9.0, 3.2)
    late, latency = figure.subplots(1, 2)
    _histogram(late, watch.slots.late_s, "Measurements later than due (ms)")
    _histogram(latency, watch.latency_s, "Command after its measurements (ms)")
    late.set_ylabel("Periods")
    return png(figure, CHART_DPI)


def _histogram(axes: Axes, times_s: Sequence[float], label: str) -> None:
    axes.hist(np.asarray(times_s) * _MS_PER_S, bins=_BINS, color=CONTROLLER_COLOURS[0], log=True)
    axes.set_xlabel(label)
    axes.set_axisbelow(True)
    axes.grid(True, axis="y", color="#E4E4E4", lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)
