"""Plots of an explanation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bms.arrays import Array
from bms.drawing import new_figure
from bms.studies.explanation.explain import EdgeExplanation, Explanation, Sensitivity
from bms.studies.explanation.symbols import input_symbol, input_unit, node_symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANEL_INCHES = (3.4, 3.0)
_PANELS_A_ROW = 4
_EDGE, _FORMULA, _DATA = "tab:blue", "tab:orange", "0.82"
_BINS = 24
_BINS_A_BAR = 5
_FEWEST_IN_BIN = 8
_LEAST_SENSITIVITY_K = 1e-5
_TINY_K = 1e-5


def layer_figure(explanation: Explanation, layer: int, input_names: Sequence[str]) -> Figure:
    """Every edge function of a layer with its formula and the density of the data."""
    edges = [edge for row in explanation.edges[layer] for edge in row]
    figure, panels = _panels(len(edges))
    last = layer == len(explanation.edges) - 1
    for edge, axes in zip(edges, panels):
        _draw_edge(axes, edge)
        if layer == 0:
            name = input_names[edge.source]
            axes.set_xlabel(_quantity(f"${input_symbol(name)[1]}$", input_unit(name)))
        else:
            axes.set_xlabel(f"${node_symbol(layer, edge.source + 1)[1]}$")
        target = r"\hat T_c" if last else node_symbol(layer + 1, edge.target + 1)[1]
        axes.set_ylabel(f"contribution to ${target}$" + (" in K" if last else ""))
    _add_legend(figure, panels)
    return figure


def sensitivity_figure(explanation: Explanation) -> Figure:
    """dThat/dx over each input: median and range over the data, range over the box."""
    figure, panels = _panels(len(explanation.sensitivities))
    for sensitivity, axes in zip(explanation.sensitivities, panels):
        _draw_sensitivity(axes, sensitivity)
    _add_legend(figure, panels)
    return figure


def _add_legend(figure: Figure, panels: list[Axes]) -> None:
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=3 if len(panels) > 1 else 1,
        frameon=False,
    )


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(count, _PANELS_A_ROW)
    rows = -(-count // columns)
    width, height = _PANEL_INCHES
    figure = new_figure(max(columns * width, 4.6), rows * height + 0.3)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[count:]:
        axes.set_axis_off()
    return figure, list(grid[:count])


def _draw_edge(axes: Axes, edge: EdgeExplanation) -> None:
    density = axes.twinx()
    shares, bounds = edge.density.reshape(-1, _BINS_A_BAR).sum(axis=1), edge.bins[::_BINS_A_BAR]
    density.stairs(shares, bounds, fill=True, color=_DATA)
    density.set_ylim(0.0, 2.5 * float(shares.max()))
    density.set_yticks([])
    # The twin is drawn last by default; the data belong behind the curves.
    axes.set_zorder(density.get_zorder() + 1)
    axes.patch.set_visible(False)
    axes.plot([], [], color=_DATA, linewidth=8, label="density of the data")
    axes.plot(edge.x, edge.values, color=_EDGE, linewidth=2.5, label="edge of the network")
    reached = np.linspace(edge.bins[0], edge.bins[-1], len(edge.x))
    axes.plot(
        reached,
        edge.approximation(reached),
        color=_FORMULA,
        linestyle="--",
        label="elementary function",
    )
    axes.set_title(
        f"{edge.approximation.form}, RMSE {_error(edge.rmse_K)}, "
        f"largest {_error(edge.max_abs_error_K)}",
        fontsize=8,
    )
    _at_least(axes, 1e-3 * float(np.abs(edge.values).max()))
    axes.grid(alpha=0.3)


def _draw_sensitivity(axes: Axes, sensitivity: Sensitivity) -> None:
    symbol, unit = f"{input_symbol(sensitivity.name)[1]}", input_unit(sensitivity.name)
    for x, slopes_K, color, label in (
        (sensitivity.box_x, sensitivity.box_K, _DATA, "range over the box"),
        (sensitivity.data_x, sensitivity.data_K, "tab:cyan", "range over the data"),
    ):
        middles, bands = _bands(x, slopes_K)
        axes.fill_between(middles, bands[0], bands[2], color=color, label=label)
    axes.plot(middles, bands[1], color=_EDGE, linewidth=2, label="median over the data")
    axes.set_xlabel(_quantity(f"${symbol}$", unit))
    axes.set_ylabel(_quantity(rf"$\partial \hat T_c / \partial {symbol}$", f"K/{unit or '1'}"))
    axes.ticklabel_format(useOffset=False)
    _at_least(axes, max(0.01 * float(np.abs(sensitivity.data_K).max()), _LEAST_SENSITIVITY_K))
    axes.grid(alpha=0.3)


def _at_least(axes: Axes, span: float) -> None:
    """Widen the y axis, so that rounding does not look like a function."""
    low, high = axes.get_ylim()
    beyond = 0.5 * (span - (high - low))
    if beyond > 0.0:
        axes.set_ylim(low - beyond, high + beyond)


def _error(value_K: float) -> str:
    if value_K < _TINY_K:
        return f"<{_TINY_K * 1e3:g} mK"
    return f"{value_K:.2f} K" if value_K >= 1.0 else f"{value_K * 1e3:.3g} mK"


def _bands(x: Array, values: Array) -> tuple[Array, Array]:
    """Middles (M,) of bins of x that hold enough, and least, median and largest value (3, M)."""
    bounds = np.linspace(float(x.min()), float(x.max()), _BINS + 1)
    number = np.clip(np.digitize(x, bounds) - 1, 0, _BINS - 1)
    filled = [n for n in range(_BINS) if np.count_nonzero(number == n) >= _FEWEST_IN_BIN]
    filled = filled or [int(number[0])]
    bands = [np.quantile(values[number == n], [0.0, 0.5, 1.0]) for n in filled]
    middles: Array = (0.5 * (bounds[1:] + bounds[:-1]))[filled]
    return middles, np.transpose(bands)


def _quantity(symbol: str, unit: str) -> str:
    return f"{symbol} in {unit}" if unit else symbol
