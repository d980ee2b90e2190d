"""The whole screen: compact on 80 by 24 characters, in frames where there is room."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.layout import Layout
from rich.panel import Panel

from hil_sim.monitor import blocks, wording
from hil_sim.monitor.gauges import gauges
from hil_sim.monitor.model import Snapshot
from hil_sim.monitor.presets import PresetInForce

_ROOMY_WIDTH, _ROOMY_HEIGHT = 100, 34
_FULL_HEIGHT = 24
"""Rows that the compact screen of a charge fills to the last."""
_HEADER_ROWS, _GAUGE_ROWS, _DECISION_ROWS, _RECEIVER_ROWS, _FOREIGN_ROWS = 2, 5, 3, 5, 2
_FRAME = 2
_MESSAGES_WIDTH = 43


@dataclass(frozen=True)
class Screen:
    """A snapshot as something that rich can show at any size."""

    snapshot: Snapshot
    in_force: PresetInForce
    bus: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        height = options.height or console.size.height
        is_roomy = options.max_width >= _ROOMY_WIDTH and height >= _ROOMY_HEIGHT
        yield self._layout(is_roomy, not is_roomy and height > _FULL_HEIGHT)

    def _layout(self, is_roomy: bool, has_gap: bool) -> Layout:
        parts = self._parts()
        has_remark = bool(self.in_force.remark)
        frame = _FRAME if is_roomy else 0

        def area(name: str, rows: int | None = None) -> Layout:
            content = parts[name]
            return Layout(
                Panel(content, title=name, title_align="left") if is_roomy else content,
                size=None if rows is None else rows + frame,
            )

        right = Layout()
        received = area("received by the ECU", _RECEIVER_ROWS)
        if is_roomy:
            right.split_column(received, area("faults"), area("foreign", _FOREIGN_ROWS))
        else:
            # Many faults push the foreign frames down, rather than end at a border.
            right.split_column(received, Layout(Group(parts["faults"], parts["foreign"])))
        left = area("messages")
        left.size = _MESSAGES_WIDTH + 2 * frame
        bottom = Layout()
        bottom.split_row(left, right)
        screen = Layout()
        screen.split_column(
            Layout(parts["header"], size=_HEADER_ROWS + has_remark),
            area("cell", _GAUGE_ROWS),
            # Without frames an empty line sets the tables apart, where there is room for it.
            area("decision", _DECISION_ROWS + has_gap),
            bottom,
        )
        return screen

    def _parts(self) -> Mapping[str, RenderableType]:
        snapshot = self.snapshot
        return {
            "header": Group(
                blocks.header(
                    snapshot,
                    wording.state(snapshot),
                    snapshot.readings["DiagnosticState"],
                    self.bus,
                ),
                blocks.identity(snapshot, self.in_force),
            ),
            "cell": gauges(snapshot, self.in_force.preset),
            "decision": blocks.decision(snapshot),
            "messages": blocks.messages(snapshot),
            "received by the ECU": blocks.receivers(snapshot),
            "foreign": blocks.foreign(snapshot),
            "faults": blocks.faults(snapshot),
        }
