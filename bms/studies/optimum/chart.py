"""The currents of the bounds, and where they lead temperatures and state of charge."""

from __future__ import annotations

import numpy as np

from bms.drawing import new_figure
from bms.files import png
from bms.studies.optimum.answer import Case

# Okabe and Ito's colours, which stay apart for colour-blind readers and in grey.
_COLOURS = ("#0072B2", "#D55E00")
_DPI = 130


def chart(title: str, cases: list[Case]) -> bytes:
    """PNG with current, temperatures and state of charge over time of each case."""
    figure = new_figure(9.0, 7.0)
    currents, temperatures, charges = figure.subplots(3, 1, sharex=True)
    for case, colour in zip(cases, _COLOURS):
        bound = case.bound
        ends_s = bound.time_s * np.arange(bound.samples + 1) / bound.samples
        label = f"{case.name}: {case.stated_s:.1f} s"
        currents.stairs(-bound.current_A, ends_s, color=colour, lw=1.6, label=label, baseline=None)
        temperatures.plot(ends_s, bound.temperatures_K[:, 0], color=colour, lw=1.6)
        temperatures.plot(ends_s, bound.temperatures_K[:, 1], color=colour, lw=1.0, ls="--")
        charges.plot(ends_s, bound.soc, color=colour, lw=1.6)
    limit_K = cases[0].charge.limits.max_core_temperature_K
    temperatures.axhline(limit_K, color="#7A1F5C", lw=0.9, ls=":")
    currents.set_ylabel("Current (A)")
    temperatures.set_ylabel("Core (line), surface\n(dashes), limit (K)")
    charges.set_ylabel("State of\ncharge (–)")
    charges.set_xlabel("Time since the start of the charge (s)")
    for axes in (currents, temperatures, charges):
        axes.grid(True, color="#E4E4E4", lw=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    currents.legend(loc="upper center", frameon=False)
    currents.set_title(title, fontsize=10)
    return png(figure, _DPI)
