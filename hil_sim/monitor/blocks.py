"""The parts of the screen other than the gauges."""

from __future__ import annotations

from typing import Protocol, get_args

from rich.console import Group
from rich.table import Table
from rich.text import Text

from hil_sim.bus.catalog import (
    ActiveConstraint,
    CommandState,
    Message,
    OptionalName,
    ReportedState,
)
from hil_sim.monitor import wording
from hil_sim.monitor.model import MOST_COUNTED, Reading, ReceiverReport, Snapshot
from hil_sim.monitor.presets import PresetInForce
from hil_sim.monitor.traffic import MessageTraffic

_STATE_STYLES: dict[float | None, str] = {
    CommandState.CHARGING: "black on green",
    CommandState.DERATED: "black on yellow",
    CommandState.COMPLETE: "black on cyan",
    CommandState.FAULT: "white on red",
}
_OTHER_STATE_STYLE = "black on white"
_RECEIVER_STYLES = {ReportedState.VALID.label: "green", ReportedState.INVALID.label: "red"}
_NOT_LIMITING = (ActiveConstraint.NONE.label, ActiveConstraint.INVALID.label, wording.NOT_AVAILABLE)
_WRONG = "bold red"
# What an undisturbed charge does without takes no room until it comes.
_SELDOM = (*get_args(OptionalName), Message.PLAN, Message.START, Message.BOOT_REFUSAL)


class Paced(Protocol):
    """What is known of when frames come; as a snapshot of a cell or of a pack has it."""

    @property
    def silence_s(self) -> float | None: ...
    @property
    def is_silent(self) -> bool: ...
    @property
    def is_lock_step(self) -> bool: ...


def header(paced: Paced, state: str, reading: Reading, bus: str) -> Table:
    """An ECU's state and its reading, bus, what sets the pace, and how to leave."""
    left = Text(f" {state} ", f"bold {_state_style(reading)}")
    if reading.is_stale:
        left.append(" stale ", _WRONG)
    table = Table.grid(padding=(0, 2, 0, 0), expand=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, ratio=1)
    table.add_column(no_wrap=True)
    table.add_row(left, Text.assemble(f"{bus}  ", _pace(paced)), Text("q quits", "dim"))
    return table


def _state_style(reading: Reading) -> str:
    if reading.is_stale:
        return _OTHER_STATE_STYLE
    return _STATE_STYLES.get(reading.value, _OTHER_STATE_STYLE)


def _pace(paced: Paced) -> Text:
    if paced.silence_s is None:
        return Text("waiting for frames", "yellow")
    if paced.is_silent:
        return Text(f"silent for {wording.duration(paced.silence_s)}", _WRONG)
    return Text("lock step (SYNC)" if paced.is_lock_step else "real time (no SYNC)")


def identity(snapshot: Snapshot, in_force: PresetInForce) -> Text:
    """What the ECU runs, with the preset whose limits are shown; below it what is amiss there."""
    lines = []
    if snapshot.identity is not None:
        known = snapshot.identity
        name = in_force.preset.name if in_force.preset else "preset"
        lines.append(
            Text(
                f"firmware {known.firmware_version}  model {known.model_hash}  "
                f"{name} ({known.preset_hash})"
            )
        )
    for wrong in (snapshot.foreign_content, snapshot.restarts):
        if wrong is not None:
            lines.append(Text(wrong, _WRONG))
    if in_force.remark:
        lines.append(Text(in_force.remark, "yellow"))
    return Text("\n", no_wrap=True, overflow="ellipsis").join(lines)


def decision(snapshot: Snapshot) -> Table:
    """What the ECU commands, between which currents and why; the coolant beside it."""
    readings = snapshot.readings
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    constraint = wording.constraint(snapshot)
    is_limiting = constraint not in _NOT_LIMITING
    command = Text.assemble(
        (wording.quantity(readings["CommandCurrent"], 3, "A"), "bold"),
        f"   admitted {wording.interval(snapshot)}   constraint ",
        (constraint, "bold yellow" if is_limiting else "bold"),
    )
    margins = Text(
        "  ".join(
            (
                f"voltage {wording.quantity(readings['VoltageMargin'], 4, 'V')}",
                f"SoC {wording.quantity(readings['SocMargin'], 4, '/s')}",
                f"core {wording.quantity(readings['CoreMargin'], 3, 'K/s')}",
                f"surface {wording.quantity(readings['SurfaceMargin'], 3, 'K/s²')}",
            )
        )
    )
    coolant = Text(
        f"{wording.quantity(readings['CoolantTemperature'], 2, 'K')}   "
        f"cooling power {wording.quantity(readings['CoolingPower'], 3, 'W')}"
    )
    if readings["InDomain"].value == 0.0:
        coolant.append("   estimate outside its domain", _WRONG)
    rows = (
        ("command", command, "CommandCurrent"),
        ("margins", margins, "VoltageMargin"),
        ("coolant", coolant, "CoolantTemperature"),
    )
    for label, text, signal in rows:
        table.add_row(label, _marked(text, readings[signal].is_stale))
    return table


def _marked(text: Text, is_stale: bool) -> Text:
    if not is_stale:
        return text
    text.stylize("dim")
    return Text.assemble(("stale ", "red"), text)


def messages(snapshot: Snapshot) -> Table:
    """Rate, age and refused frames of every message."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False, header_style="dim")
    table.add_column("id", no_wrap=True)
    table.add_column("message", no_wrap=True)
    table.add_column("rate/s", justify="right", no_wrap=True, min_width=6)
    table.add_column("age", justify="right", no_wrap=True, min_width=6)
    table.add_column("bad", justify="right", no_wrap=True, min_width=4)
    for message in snapshot.messages:
        if message.age_s is None and message.name in _SELDOM:
            continue
        rate, age = _rate_and_age(message)
        refused = Text(str(message.refused), _WRONG if message.refused else "")
        table.add_row(f"{message.frame_id:03X}", message.name, rate, age, refused)
    return table


def _rate_and_age(message: MessageTraffic) -> tuple[Text, Text]:
    if message.age_s is None:
        return Text(wording.NOT_AVAILABLE, "dim"), Text(wording.NOT_AVAILABLE, "dim")
    age = wording.duration(message.age_s)
    if message.is_stale:
        return Text("stale", "red"), Text(age, "red")
    return Text(f"{message.rate_per_s:.1f}"), Text(age)


def receivers(snapshot: Snapshot) -> Table:
    """What the ECU's end-to-end supervision says of the messages that it receives."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False, header_style="dim")
    table.add_column("id", no_wrap=True)
    table.add_column("at ECU", no_wrap=True, min_width=7)
    for heading in ("crc", "len", "rep", "lost", "reord"):
        table.add_column(heading, justify="right", no_wrap=True)
    for report in snapshot.receivers:
        if report.state in (None, ReportedState.NO_DATA.label) and report.name in _SELDOM:
            continue
        table.add_row(f"{report.frame_id:03X}", _receiver_state(report), *_counts(report))
    return table


def _receiver_state(report: ReceiverReport) -> Text:
    if report.is_stale:
        return Text("stale", "red")
    if report.state is None:
        return Text(wording.NOT_AVAILABLE, "dim")
    style = _RECEIVER_STYLES.get(report.state.lower(), "yellow")
    is_missed = report.name not in get_args(OptionalName)
    return Text(report.state, style if is_missed or style == "green" else "dim")


def _counts(report: ReceiverReport) -> list[Text]:
    return [
        Text(f"{count}+" if count == MOST_COUNTED else str(count), _WRONG if count else "")
        for count in report.counts
    ]


def faults(snapshot: Snapshot) -> Group:
    """First, active and latched faults by name, with their number where it is not plain."""
    is_stale = snapshot.readings["LatchedFaults"].is_stale
    lines = [("first fault", wording.first_fault(snapshot))]
    for label, signal in (("active", "ActiveFaults"), ("latched", "LatchedFaults")):
        names = snapshot.faults(signal)
        number = f" ({len(names)})" if names and len(names) > 1 else ""
        lines.append((label + number, wording.fault_names(names)))
    texts = []
    for label, text in lines:
        style = {"none": "green", wording.NOT_AVAILABLE: "dim"}.get(text, _WRONG)
        texts.append(Text.assemble(label, "  ", _marked(Text(text, style), is_stale)))
    return Group(*texts)


def foreign(snapshot: Snapshot) -> Text:
    """Frames that do not belong to the system."""
    traffic = snapshot.foreign
    if not traffic.frames:
        return Text.assemble("foreign frames ", ("none", "green"))
    text = Text.assemble("foreign frames ", (str(traffic.frames), "bold yellow"))
    text.append(f", {traffic.rate_per_s:.0f}/s, {traffic.identifiers} ids")
    for kind, count in traffic.kinds:
        text.append(f", {count} {kind.value}")
    return text
