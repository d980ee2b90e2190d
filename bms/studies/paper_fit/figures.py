"""The seven figures of the paper that the fit aims at, and how near is near enough."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One published number with its unit and the difference that counts as one unit of misfit."""

    name: str
    unit: str
    paper: float
    tolerance: float


_PEAK_K = 0.5
_TIME_SHARE = 0.02

FIGURES = tuple(
    Figure(f"{controller} {name}", unit, paper, _PEAK_K if unit == "K" else _TIME_SHARE * paper)
    for controller, name, unit, paper in (
        ("KAN-rCBF", "core peak", "K", 323.0),
        ("KAN-rCBF", "surface peak", "K", 319.06),
        ("KAN-rCBF", "time to full", "s", 784.54),
        ("KAN-rCBF", "first derating", "s", 171.60),
        ("S-CBF", "core peak", "K", 327.97),
        ("S-CBF", "surface peak", "K", 323.11),
        ("S-CBF", "time to full", "s", 712.96),
    )
)
"""Source: paper, section "Simulation results"."""
