"""Picture of the sweep over the grid."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bms.bounds.record import TheoremBound
from bms.drawing import new_figure
from bms.files import png, write_bytes


def write_chart(theorem: TheoremBound, path: Path) -> None:
    """Write the distances over G, the fitted bound, its range and the floor as PNG.

    InputError when the file cannot be written.
    """
    figure = new_figure(7.2, 4.6)
    axes = figure.subplots()
    axes.loglog(theorem.grids, theorem.largest_K, "o-", color="C0", label="largest, data and box")
    axes.loglog(theorem.grids, theorem.rms_K, "s-", color="C2", label="RMS, data")
    rate = theorem.rate
    if rate is not None:
        axes.axvspan(
            rate.first_grid,
            rate.last_grid,
            color="C1",
            alpha=0.12,
            label=f"rate holds, G = {rate.first_grid} to {rate.last_grid}",
        )
        line = np.array([rate.first_grid, rate.last_grid], dtype=np.float64)
        axes.loglog(
            line,
            rate.constant_K * line**-theorem.order,
            "--",
            color="C1",
            label=f"{rate.constant_K:.3g} K $G^{{-{theorem.order}}}$ (measured "
            f"exponent {rate.exponent:.2f})",
        )
    axes.axhline(
        theorem.floor_K,
        color="C3",
        linestyle=":",
        label=f"largest error of the smooth network, {theorem.floor_K:.2g} K",
    )
    axes.axvline(
        theorem.model_grid,
        color="0.5",
        linewidth=1.0,
        label=f"G = {theorem.model_grid} of the model",
    )
    axes.set_xticks(theorem.grids)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xticks([], minor=True)
    axes.set_xlabel("grid intervals G")
    axes.set_ylabel("distance to the smooth network (K)")
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(fontsize="small", loc="lower left")
    write_bytes(path, png(figure, 130))
