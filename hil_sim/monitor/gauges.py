"""The quantities of the cell as a table: value, bar towards its limit, limit."""

from __future__ import annotations

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from bms.presets import Preset
from hil_sim.monitor.bar import Bar
from hil_sim.monitor.model import Snapshot
from hil_sim.monitor.quantities import Quantity, quantities

_VALUE_WIDTH = 16


def gauges(snapshot: Snapshot, preset: Preset | None) -> Table:
    """Temperatures, voltage, state of charge and current; without a preset there are no limits."""
    table = Table.grid(padding=(0, 2, 0, 0), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, min_width=_VALUE_WIDTH, justify="right")
    table.add_column(ratio=1, no_wrap=True)
    table.add_column(no_wrap=True, justify="right")
    for quantity in quantities(snapshot, preset):
        value = Text(quantity.text, "dim" if quantity.reading.is_stale else "bold")
        table.add_row(quantity.label, value, _bar(quantity), f"limit {quantity.limit_text}")
    return table


def _bar(quantity: Quantity) -> RenderableType:
    reading, range_ = quantity.reading, quantity.range
    if reading.is_stale:
        return Text("stale", "red")
    if reading.value is None or range_ is None:
        return ""
    return Bar(reading.value, range_.idle, range_.limit, quantity.bound)
