"""Charts of a run: the five panels of the paper's comparison, and the estimate with its error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bms.drawing import new_figure
from bms.files import png
from bms.presets.schema import Limits
from hil_sim.run.result import RunResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's colours, which stay apart for colour-blind readers and in grey.
CONTROLLER_COLOURS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#F0E442",
)
ESTIMATE_COLOUR, LIMIT_COLOUR = "#000000", "#7A1F5C"
CHART_DPI = 130
_LEGEND_COLUMNS = 4


def charge_chart(
    limits: Limits, results: Sequence[RunResult], bound_s: float | None = None
) -> bytes:
    """PNG with current, voltage, state of charge, surface and core temperature over time.

    `bound_s` marks the time before which no controller can be done.
    """
    figure = new_figure(9.0, 11.0)
    panels = figure.subplots(5, 1, sharex=True)
    quantities = (
        ("current_A", "Current\n(A)", limits.reference_current_A, "reference {:g} A"),
        ("voltage_V", "Voltage\n(V)", limits.max_voltage_V, "limit {:g} V"),
        ("soc", "State of\ncharge (–)", limits.max_soc, "limit {:g}"),
        (
            "surface_temperature_K",
            "Surface\ntemperature (K)",
            limits.max_surface_temperature_K,
            "limit {:g} K",
        ),
        (
            "core_temperature_K",
            "Core\ntemperature (K)",
            limits.max_core_temperature_K,
            "limit {:g} K",
        ),
    )
    for axes, (name, label, bound, bound_text) in zip(panels, quantities):
        for result, colour in zip(results, CONTROLLER_COLOURS):
            _line(axes, result, name, colour, result.summary.name, width=1.8)
        _bound(axes, bound, bound_text.format(bound))
        axes.set_ylabel(label)
        if bound_s is not None:
            axes.axvline(bound_s, color=LIMIT_COLOUR, lw=1.1, ls=(0, (5, 2)))
    if bound_s is not None:
        _name_bound(panels[2], bound_s)
    for result in results:
        if result.summary.kan_rmse_K is not None:
            _line(
                panels[4],
                result,
                "estimated_core_temperature_K",
                ESTIMATE_COLOUR,
                "core estimate (KAN)",
                width=1.0,
                dashes=(4, 3),
            )
    panels[4].set_xlabel("Time since the start of the charge (s)")
    handles, labels = panels[4].get_legend_handles_labels()
    # Every run with an estimate has a line of that name.
    entries = dict(zip(labels, handles))
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside upper center",
        ncols=min(len(entries), _LEGEND_COLUMNS),
        frameon=False,
    )
    return png(figure, CHART_DPI)


def estimate_chart(result: RunResult) -> bytes:
    """PNG with true and estimated core temperature, and the error within its bound, over time."""
    figure = new_figure(9.0, 5.0)
    temperatures, errors = figure.subplots(2, 1, sharex=True)
    colour = CONTROLLER_COLOURS[0]
    _line(temperatures, result, "core_temperature_K", colour, "true", width=1.8)
    _line(
        temperatures,
        result,
        "estimated_core_temperature_K",
        ESTIMATE_COLOUR,
        "estimated",
        width=1.0,
        dashes=(4, 3),
    )
    temperatures.set_ylabel("Core\ntemperature (K)")
    temperatures.legend(frameon=False, loc="lower right")
    series = result.series
    estimate = np.asarray(series.estimated_core_temperature_K, dtype=float)
    errors.plot(series.time_s, estimate - np.asarray(series.core_temperature_K), color=colour, lw=1)
    bound_K = result.summary.error_bound_K
    if bound_K is not None:
        _bound(errors, bound_K, f"bound ±{bound_K:g} K")
        _bound(errors, -bound_K, None)
    errors.set_ylabel("Estimate –\ntruth (K)")
    errors.set_xlabel("Time since the start of the charge (s)")
    return png(figure, CHART_DPI)


def _line(
    axes: Axes,
    result: RunResult,
    name: str,
    colour: str,
    label: str,
    width: float,
    dashes: tuple[int, int] | None = None,
) -> None:
    values = np.asarray(getattr(result.series, name), dtype=float)
    style = "-" if dashes is None else (0, dashes)
    axes.plot(result.series.time_s, values, color=colour, lw=width, ls=style, label=label)
    axes.grid(True, color="#E4E4E4", lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _bound(axes: Axes, value: float, label: str | None) -> None:
    axes.axhline(value, color=LIMIT_COLOUR, lw=1.1, ls=(0, (1, 1.5)))
    axes.margins(y=0.12)
    if label is not None:
        axes.annotate(
            label,
            (1.0, value),
            xycoords=("axes fraction", "data"),
            xytext=(-2, 3),
            textcoords="offset points",
            ha="right",
            color=LIMIT_COLOUR,
            fontsize=8.5,
        )


def _name_bound(axes: Axes, bound_s: float) -> None:
    axes.annotate(
        f"no controller\nis full before\n{bound_s:g} s (physics)",
        (bound_s, 0.06),
        xycoords=("data", "axes fraction"),
        xytext=(-5, 0),
        textcoords="offset points",
        ha="right",
        color=LIMIT_COLOUR,
        fontsize=8.5,
    )
