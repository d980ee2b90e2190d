"""What `bms replay` prints: JSON with units in its keys, or tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from bms.text_table import TextTable
from hil_sim.bus.catalog import NETWORK_VERSION
from hil_sim.bus.database import Values
from hil_sim.logs import Unread, described
from hil_sim.replay.builds import LogVerdict
from hil_sim.replay.comparison import Comparison, PeriodDifference
from hil_sim.replay.outcome import Outcome
from hil_sim.replay.recording import Recording
from hil_sim.replay.signals import Signals


@dataclass(frozen=True)
class ReplayReport:
    """One replay and the firmware that it ran on; outcomes of the log, then of the replay."""

    recording: Recording
    signals: Signals
    comparison: Comparison
    outcomes: tuple[Outcome, Outcome]
    preset: str
    model_hash: str
    is_identity_compared: bool
    foreign_content: str | None
    """What is wrong with the content of the recorded ECU's calibration, if anything."""

    def to_json(self) -> dict[str, Any]:
        """Everything, with units in the keys."""
        comparison, signals = self.comparison, self.signals
        recorded, replayed = self.outcomes
        first = comparison.first
        return {
            "log": str(self.recording.path),
            "network_version": NETWORK_VERSION,
            "preset": self.preset,
            "model_hash": self.model_hash,
            "identity_compared": self.is_identity_compared,
            "foreign_content": self.foreign_content,
            "lock_step": self.recording.lock_step,
            "periods": comparison.periods,
            "differing_periods": comparison.differing_periods,
            "equal": comparison.is_equal,
            "log_charge_Ah": recorded.charge_Ah,
            "replay_charge_Ah": replayed.charge_Ah,
            "unread": unread_json(self.recording.unread),
            "first_difference": None if first is None else first_json(first, signals),
            "signals": _signals_json(comparison, signals),
        }

    def print(self, console: Console) -> None:
        """The first difference and the largest ones, or that there is none."""
        comparison = self.comparison
        name = f"{self.recording.path}: {comparison.periods} periods on preset '{self.preset}'"
        version = f"version {NETWORK_VERSION} of the CAN database"
        _say(console, f"{name}, model {self.model_hash}, {version}")
        if self.recording.unread:
            _say(console, f"not read: {described(self.recording.unread)}")
        if not self.is_identity_compared:
            _say(console, "its ECU had another preset or model, so Identity is not compared")
        if self.foreign_content is not None:
            _say(console, f"its ECU: {self.foreign_content}")
        if comparison.first is None:
            _say(console, "every frame of the ECU is the same")
            return
        share = f"{comparison.differing_periods} of {comparison.periods}"
        _say(console, f"the ECU says something else in {share} periods")
        first_table(comparison.first, self.signals).print(console)
        _largest_table(comparison, self.signals).print(console)
        recorded, replayed = (side.charge_Ah for side in self.outcomes)
        _say(console, f"charge commanded: {recorded:.5f} Ah in the log, {replayed:.5f} Ah now")


def builds_json(builds: tuple[Path, Path], verdicts: Sequence[LogVerdict]) -> dict[str, Any]:
    """Where two builds differ, by log."""
    return {
        "build_a": str(builds[0]),
        "build_b": str(builds[1]),
        "equal": all(verdict.comparison.is_equal for verdict in verdicts),
        "logs": [_verdict_json(verdict) for verdict in verdicts],
    }


def print_builds(
    console: Console, builds: tuple[Path, Path], verdicts: Sequence[LogVerdict]
) -> None:
    """Print a row for each log, then the faults that one build alone raises."""
    _say(console, f"A: {builds[0]}")
    _say(console, f"B: {builds[1]}, differences are B less A")
    table = TextTable("log", "periods", "differ", "first", "current", "charge")
    for verdict in verdicts:
        comparison = verdict.comparison
        first = comparison.first
        table.add_row(
            verdict.log.name,
            str(comparison.periods),
            str(comparison.differing_periods),
            "" if first is None else f"{first.time_s:.1f} s",
            f"{verdict.largest_current_difference_A:.3f} A" if first else "",
            f"{1000.0 * verdict.charge_difference_Ah:+.3f} mAh" if first else "",
        )
    table.print(console)
    for verdict in verdicts:
        for build, faults in (("A", verdict.gone_faults), ("B", verdict.new_faults)):
            if faults:
                _say(console, f"{verdict.log.name}: {build} alone raises {', '.join(faults)}")
        if verdict.unread:
            _say(console, f"{verdict.log.name}: not read: {described(verdict.unread)}")
    differing = sum(not verdict.comparison.is_equal for verdict in verdicts)
    _say(console, f"the builds differ on {differing} of {len(verdicts)} logs")


def unread_json(unread: Mapping[Unread, int]) -> dict[str, int]:
    """How many of what was not read, by kind."""
    return {kind.name.lower(): unread[kind] for kind in Unread if unread.get(kind)}


def _say(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def _values_json(values: Values, signals: Signals) -> dict[str, float | None]:
    return {signals.key(name): value for name, value in values.items()}


def first_json(
    first: PeriodDifference, signals: Signals, sides: tuple[str, str] = ("log", "replay")
) -> dict[str, Any]:
    """The first period that differs: what both sides got and what each said."""
    one, other = first.sides
    return {
        "period": first.period,
        "time_s": first.time_s,
        "differing_signals": list(first.signals),
        "received": _values_json(first.received, signals),
        sides[0]: _values_json(one, signals),
        sides[1]: _values_json(other, signals),
    }


def _signals_json(comparison: Comparison, signals: Signals) -> list[dict[str, Any]]:
    return [
        {
            "signal": difference.signal,
            "unit": signals.unit(difference.signal),
            "differing_periods": difference.periods,
            "largest_difference": difference.largest,
        }
        for difference in comparison.signals.values()
    ]


def _verdict_json(verdict: LogVerdict) -> dict[str, Any]:
    comparison = verdict.comparison
    first = comparison.first
    return {
        "log": verdict.log.name,
        "periods": comparison.periods,
        "differing_periods": comparison.differing_periods,
        "first_difference_period": None if first is None else first.period,
        "first_difference_s": None if first is None else first.time_s,
        "first_differing_signals": [] if first is None else list(first.signals),
        "largest_current_difference_A": verdict.largest_current_difference_A,
        "charge_difference_Ah": verdict.charge_difference_Ah,
        "new_faults": list(verdict.new_faults),
        "gone_faults": list(verdict.gone_faults),
        "unread": unread_json(verdict.unread),
    }


def first_table(
    first: PeriodDifference, signals: Signals, sides: tuple[str, str] = ("log", "replay")
) -> TextTable:
    """What both sides got in the first period that differs, and what each said."""
    title = f"first difference: period {first.period}, {first.time_s:.3f} s"
    table = TextTable("", *sides, "unit", title=title)
    for name in first.received:
        text = signals.text(name, first.received)
        table.add_row(f"got {name}", text, text, signals.unit(name))
    table.add_section()
    one, other = first.sides
    for name in dict.fromkeys((*one, *other)):
        cells = [signals.text(name, side) for side in (one, other)]
        style = "bold red" if name in first.signals else ""
        mark = "*" if name in first.signals else " "
        table.add_row(f"{mark} {name}", *cells, signals.unit(name), style=style)
    for name in first.signals:
        if name not in one and name not in other:
            table.add_row(f"* {name}", "differs", "differs", "", style="bold red")
    return table


def _largest_table(comparison: Comparison, signals: Signals) -> TextTable:
    table = TextTable("", "periods", "largest", "unit", title="all differences")
    for difference in comparison.signals.values():
        largest = "" if difference.largest is None else f"{difference.largest:.6g}"
        unit = signals.unit(difference.signal)
        table.add_row(difference.signal, str(difference.periods), largest, unit)
    return table
