"""What was shown of one barrier."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bms.verification.domain import Point


@dataclass(frozen=True)
class Shortfall:
    """The worst state that nothing was shown of, and what the margin lacks there.

    `missing` is in the unit of the margin. Where it is not positive this state is kept, and only
    the search has not ended.
    """

    state: Mapping[str, float]
    missing: float


@dataclass(frozen=True)
class Certificate:
    """Number of boxes examined; `open_low` and `open_high` span those that nothing was shown of.

    `by_history` says that some boxes needed the domain's bound on the fall throughout the hold.
    """

    name: str
    boxes: int
    open_boxes: int
    open_low: Point | None = None
    open_high: Point | None = None
    shortfall: Shortfall | None = None
    by_history: bool = False

    @property
    def holds(self) -> bool:
        """Whether every box was shown safe."""
        return self.open_boxes == 0
