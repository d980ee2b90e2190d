"""New figures of matplotlib, which is loaded by the first: most commands draw nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure of that size in inches, whose parts keep clear of each other."""
    from matplotlib.figure import Figure  # noqa: PLC0415 -- longer than some commands take

    return Figure(figsize=(width_in, height_in), layout="constrained")
