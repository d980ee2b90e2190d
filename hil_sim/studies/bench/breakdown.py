"""What a measured figure is made of: parts that add up to it, and where its limit is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

REST = "rest"


@dataclass(frozen=True)
class Breakdown:
    """Parts of a figure in its unit, or in one that it follows from; the rest is one of them."""

    figure: str
    """Name of the aim that it explains."""
    unit: str
    measured: float
    wanted: float
    """What the aim asks for, in the same unit."""
    parts: dict[str, float]
    limit: str
    """What it would take to reach the aim, in a line."""

    @property
    def total(self) -> float:
        """Sum of the parts, which is what was measured."""
        return sum(self.parts.values())


def parts_with_rest(measured: float, parts: Mapping[str, float]) -> dict[str, float]:
    """The parts, largest first, and what they leave of the whole.

    The rest may be below 0 where parts were timed apart from the whole.
    """
    ordered = dict(sorted(parts.items(), key=lambda part: -part[1]))
    ordered.pop(REST, None)
    return {**ordered, REST: round(measured - sum(ordered.values()), 9)}


def grouped(counts: Mapping[str, float], groups: Mapping[str, tuple[str, ...]]) -> dict[str, float]:
    """Sums of counts by group; a name belongs to the first group with a beginning of it."""
    sums = dict.fromkeys(groups, 0.0)
    for name, value in counts.items():
        group = next((g for g, begins in groups.items() if name.startswith(begins)), REST)
        sums[group] = sums.get(group, 0.0) + value
    return {group: value for group, value in sums.items() if value > 0.0}
