"""What was shown of one barrier."""

from __future__ import annotations

from dataclasses import dataclass

from bms.verification.domain import Point


@dataclass(frozen=True)
class Certificate:
    """Number of boxes examined; `open_low` and `open_high` span those that nothing was shown of."""

    name: str
    boxes: int
    open_boxes: int
    open_low: Point | None = None
    open_high: Point | None = None

    @property
    def holds(self) -> bool:
        """Whether every box was shown safe."""
        return self.open_boxes == 0
