"""The screen of a pack: its current and limits, the cells nearest to one, faults."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.table import Table
from rich.text import Text

from bms.presets import Preset
from hil_sim.monitor import wording
from hil_sim.monitor.blocks import header
from hil_sim.monitor.model import Reading
from hil_sim.monitor.pack_model import CellState, PackSnapshot
from hil_sim.monitor.presets import PresetInForce

_OTHER_ROWS = 17
"""Rows of the screen beside those of the cells."""
_LEAST_CELLS = 5
_NAMED = 3
_LABEL_WIDTH = 7
_WRONG = "bold red"


@dataclass(frozen=True)
class PackScreen:
    """A snapshot as something that rich can show at any size."""

    snapshot: PackSnapshot
    in_force: PresetInForce
    bus: str

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        height = options.height or console.size.height
        rows = max(_LEAST_CELLS, height - _OTHER_ROWS)
        snapshot, preset = self.snapshot, self.in_force.preset
        yield Group(
            header(snapshot, _state(snapshot), snapshot.readings["PackState"], self.bus),
            _identity(snapshot, self.in_force),
            _pack(snapshot, preset),
            _extremes(snapshot),
            _cells(snapshot, preset, rows),
            _faults(snapshot),
        )


def _identity(snapshot: PackSnapshot, in_force: PresetInForce) -> Text:
    thermistors = len(snapshot.thermistors_K)
    line = Text(f"{len(snapshot.cells)} cells, {thermistors} thermistors", no_wrap=True)
    if snapshot.identity is not None:
        known = snapshot.identity
        name = in_force.preset.name if in_force.preset else "preset"
        line.append(f"  model {known.model_hash}  {name} ({known.preset_hash})")
    for remark in (snapshot.remark, in_force.remark):
        if remark:
            line.append(f"\n{remark}", "yellow")
    return line


def _pack(snapshot: PackSnapshot, preset: Preset | None) -> Table:
    """Current, voltage, coolant, decision: a row each, stale where nothing comes any more."""
    readings = snapshot.readings
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True, min_width=_LABEL_WIDTH)
    table.add_column(no_wrap=True)
    limit = "n/a" if preset is None else f"{preset.limits.reference_current_A:.3f} A"
    coolant = " … ".join(
        wording.quantity(readings[name], 2, "K")
        for name in ("CoolantInTemperature", "CoolantOutTemperature")
    )
    rows = (
        ("pack", f"{_amps(snapshot, 'PackCurrent')} (limit {limit})   "
         f"{wording.quantity(readings['PackVoltage'], 2, 'V')}", "PackCurrent"),
        ("coolant", coolant, "CoolantInTemperature"),
        ("command", f"{_amps(snapshot, 'CommandCurrent')}   admitted by all "
         f"{_amps(snapshot, 'LimitCurrent')}   {_governor(snapshot)}", "CommandCurrent"),
        ("weakest", _weakest(snapshot), "WeakestCell"),
    )  # fmt: skip
    for label, text, signal in rows:
        is_stale = readings[signal].is_stale
        shown = Text.assemble(("stale ", "red"), (text, "dim")) if is_stale else Text(text)
        table.add_row(label, shown)
    return table


def _extremes(snapshot: PackSnapshot) -> Table:
    """Hottest and fullest cells, and how far the cells are apart."""
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True, min_width=_LABEL_WIDTH)
    table.add_column(no_wrap=True)
    table.add_row("hottest", _first(snapshot, lambda cell: cell.core_K, "{:.2f} K", 1.0))
    table.add_row("fullest", _first(snapshot, lambda cell: cell.soc, "{:.2f} %", 100.0))
    table.add_row("spread", spread_text(snapshot))
    return table


def _first(
    snapshot: PackSnapshot, of: Callable[[CellState], float | None], form: str, scale: float
) -> str:
    known = [(value, cell.number) for cell in snapshot.cells if (value := of(cell)) is not None]
    most = sorted(known, key=lambda one: (-one[0], one[1]))[:_NAMED]
    return "   ".join(f"cell {n} {form.format(scale * v)}" for v, n in most) or "n/a"


def spread_text(snapshot: PackSnapshot) -> str:
    """Greatest less least of the cells' voltages, core estimates and states of charge."""
    cells = snapshot.cells
    parts = (
        ("voltage", [cell.voltage_V for cell in cells], 1000.0, 1, "mV"),
        ("core", [cell.core_K for cell in cells], 1.0, 2, "K"),
        ("state of charge", [cell.soc for cell in cells], 100.0, 2, "%"),
    )
    return "   ".join(
        f"{name} {wording.quantity(Reading(_range(values)), digits, unit, scale)}"
        for name, values, scale, digits, unit in parts
    )


def _range(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return max(known) - min(known) if known else None


def _cells(snapshot: PackSnapshot, preset: Preset | None, rows: int) -> Table:
    """The cells with the least margin first; without a preset the hottest."""
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="dim")
    for heading in ("cell", "nearest to", "left", "core", "voltage", "SoC"):
        table.add_column(heading, justify="right", no_wrap=True)
    if preset is None:
        hottest = sorted(snapshot.cells, key=lambda cell: (-(cell.core_K or 0.0), cell.number))
        shown = [(cell, "n/a", "n/a") for cell in hottest]
    else:
        nearest = snapshot.nearest(preset)
        shown = [(one.cell, one.limit, f"{100.0 * one.share:.1f} %") for one in nearest]
    governor = snapshot.cell("GoverningCell")
    for cell, limit, left in shown[:rows]:
        style = "dim" if cell.is_stale else "bold yellow" if cell.number == governor else ""
        table.add_row(
            f"{cell.number}",
            limit,
            "stale" if cell.is_stale else left,
            wording.quantity(Reading(cell.core_K), 2, "K"),
            wording.quantity(Reading(cell.voltage_V), 4, "V"),
            wording.quantity(Reading(cell.soc), 2, "%", 100.0),
            style=style,
        )
    return table


def _faults(snapshot: PackSnapshot) -> Group:
    faulty = snapshot.cell("FaultyCell")
    lines = [
        ("first fault", _first_fault(snapshot) + (f", cell {faulty}" if faulty else "")),
        ("active", wording.fault_names(snapshot.faults("ActiveFaults"))),
        ("latched", wording.fault_names(snapshot.faults("LatchedFaults"))),
        ("foreign frames", str(snapshot.foreign.frames or "none")),
        ("bad frames", str(snapshot.refused or "none")),
    ]
    texts = []
    for label, text in lines:
        style = {"none": "green", wording.NOT_AVAILABLE: "dim"}.get(text, _WRONG)
        texts.append(Text.assemble(label, "  ", (text, style)))
    return Group(*texts)


def pack_line(time_s: float, snapshot: PackSnapshot, in_force: PresetInForce) -> str:
    """State, decision, weakest cells, spread and faults of a pack at a time in s, in one line."""
    readings = snapshot.readings
    parts = [
        ("PackState", _state(snapshot)),
        ("PackCurrent", f"{len(snapshot.cells)} cells {_amps(snapshot, 'PackCurrent')}"),
        ("PackVoltage", wording.quantity(readings["PackVoltage"], 2, "V")),
        ("CommandCurrent", f"command {_amps(snapshot, 'CommandCurrent')}"),
        ("LimitCurrent", f"admitted {_amps(snapshot, 'LimitCurrent')}"),
        ("GoverningCell", _governor(snapshot)),
        ("WeakestCell", f"weakest {_weakest(snapshot)}"),
    ]
    shown = [f"{text} stale" if readings[name].is_stale else text for name, text in parts]
    if in_force.preset is not None:
        nearest = snapshot.nearest(in_force.preset)[:_NAMED]
        least = ", ".join(
            f"cell {one.cell.number} {100.0 * one.share:.1f} % of {one.limit}" for one in nearest
        )
        shown.append(f"least margins {least or 'n/a'}")
    shown += [
        f"spread {spread_text(snapshot)}",
        f"active {wording.fault_names(snapshot.faults('ActiveFaults'))}",
        f"latched {wording.fault_names(snapshot.faults('LatchedFaults'))}",
        f"foreign {snapshot.foreign.frames}",
        *(text for text in (snapshot.remark, in_force.remark) if text),
    ]
    return f"{time_s:.1f} s  " + "; ".join(shown)


def _state(snapshot: PackSnapshot) -> str:
    return snapshot.name("PackState") or wording.NOT_AVAILABLE


def _amps(snapshot: PackSnapshot, signal: str) -> str:
    return wording.quantity(snapshot.readings[signal], 3, "A")


def _governor(snapshot: PackSnapshot) -> str:
    cell, constraint = snapshot.cell("GoverningCell"), snapshot.name("GoverningConstraint")
    if constraint is None:
        return "governed by n/a"
    return f"governed by cell {cell}, {constraint.lower()}" if cell else "governed by no cell"


def _weakest(snapshot: PackSnapshot) -> str:
    cell, readings = snapshot.cell("WeakestCell"), snapshot.readings
    if cell is None:
        return wording.NOT_AVAILABLE
    core = wording.quantity(readings["WeakestCoreTemperature"], 2, "K")
    soc = wording.quantity(readings["WeakestStateOfCharge"], 2, "%", 100.0)
    outside = ", estimate outside its domain" if readings["WeakestInDomain"].value == 0.0 else ""
    return f"cell {cell}: core {core}, state of charge {soc}{outside}"


def _first_fault(snapshot: PackSnapshot) -> str:
    name = snapshot.name("FirstFault")
    return wording.NOT_AVAILABLE if name is None else "none" if name == "None" else name
