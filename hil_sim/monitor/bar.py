"""A bar from an idle value to beyond a limit, with the bound of an estimate's error."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.segment import Segment
from rich.style import Style

_BEYOND = 0.1
"""Share of the way from idle to limit that the bar goes on behind the limit."""
_NEAR = 0.02
"""Share of that way in which a value counts as at its limit."""
_LEAST_WIDTH = 8

_FREE, _BOUND, _EMPTY, _LIMIT = "━", "╌", " ", "┃"


@dataclass(frozen=True)
class Bar:
    """Fills the width that it is given; value, idle, limit and bound in one unit."""

    value: float
    idle: float
    limit: float
    bound: float = 0.0

    @property
    def color(self) -> str:
        """Green, yellow when the value is near its limit, red beyond."""
        reached = self._share(self.value)
        if reached > 1.0:
            return "red"
        return "yellow" if reached > 1.0 - _NEAR else "green"

    def cells(self, width: int) -> str:
        """The bar as text of `width` characters, with the mark of the limit."""
        filled = self._cell(self.value, width)
        reached = self._cell(self.value + self.bound, width)
        # A bound shows however small it is.
        bounded = min(max(reached, filled + (self.bound > 0.0)), width)
        bar = list(_FREE * filled + _BOUND * (bounded - filled) + _EMPTY * (width - bounded))
        bar[min(self._cell(self.limit, width), width - 1)] = _LIMIT
        return "".join(bar)

    def _share(self, value: float) -> float:
        return (value - self.idle) / (self.limit - self.idle)

    def _cell(self, value: float, width: int) -> int:
        return round(width * min(max(self._share(value) / (1.0 + _BEYOND), 0.0), 1.0))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for cell in self.cells(options.max_width):
            yield Segment(cell, Style(color="white" if cell == _LIMIT else self.color, bold=True))

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(min(_LEAST_WIDTH, options.max_width), options.max_width)
