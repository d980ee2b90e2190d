"""A benchmark's result as tables on the terminal."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from bms.text_table import TextTable, red
from hil_sim.studies.bench.aims import aims
from hil_sim.studies.bench.breakdown import Breakdown
from hil_sim.studies.bench.limits import breakdowns
from hil_sim.studies.bench.race import Absent, Timed
from hil_sim.studies.bench.run import Result
from hil_sim.studies.bench.throughput import growth

_CAMPAIGN_HEADINGS = ("runs", "runs a second", "a run takes", "wall time", "processes")
_TITLES = {
    "estimate": "Core temperature: one estimate",
    "perceptron": "For comparison: a perceptron of as many parameters",
    "decision": "Charging current: one decision",
    "period": "ECU: one control period, messages in, step, messages out",
}


def print_tables(console: Console, result: Result) -> None:
    """Every section that was run, then the aims."""
    machine = result.machine
    pinned = "" if result.core is None else f"; timed on core {result.core} alone, one thread"
    console.print(
        f"{escape(machine.cpu)}, {machine.cores} cores, {machine.system}, Python {machine.python}"
        f"{pinned}; load average at the start {machine.load_average:.2f}",
        soft_wrap=True,
    )
    _print_packages(console, result)
    c_ns = None
    for section, title in _TITLES.items():
        rows: list[Timed | Absent] = getattr(result, section)
        if rows:
            if section != "perceptron":
                c_ns = rows[0].time_ns.median if isinstance(rows[0], Timed) else None
            _ways(title, rows, c_ns).print(console)
    for speed in result.simulation:
        if speed.not_run:
            console.print(f"not run: {speed.bus}: {speed.not_run}", soft_wrap=True, markup=False)
    if any(speed.times_real_time for speed in result.simulation):
        _simulation(result).print(console)
        _layers(result).print(console)
    if result.campaign:
        _campaign(result).print(console)
    for cost in result.board:
        if cost.not_run:
            console.print(f"not run: {cost.board}: {cost.not_run}", soft_wrap=True, markup=False)
    if result.board:
        _board(result).print(console)
    print_limits(console, result)


def _ways(title: str, rows: list[Timed | Absent], c_ns: float | None) -> TextTable:
    table = TextTable("", "median", "quartiles", "times C", title=title)
    for row in rows:
        if isinstance(row, Timed):
            quartiles = row.time_ns
            table.add_row(
                row.name,
                _time(quartiles.median),
                f"{_time(quartiles.low)} .. {_time(quartiles.high)}",
                "" if c_ns is None else _ratio(quartiles.median / c_ns),
            )
    return table


def _print_packages(console: Console, result: Result) -> None:
    rows = [row for section in _TITLES for row in getattr(result, section)]
    timed = [row for row in rows if isinstance(row, Timed)]
    if timed:
        packages = dict.fromkeys(row.package for row in timed)
        console.print(
            f"{result.states} states of one charge, answers compared before timing; medians of "
            f"{timed[0].time_ns.repetitions} repetitions; {', '.join(packages)}",
            soft_wrap=True,
            markup=False,
        )
    for row in rows:
        if isinstance(row, Absent):
            console.print(f"not run: {row.name}: {row.reason}", soft_wrap=True, markup=False)


def _ratio(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 10 else f"{ratio:.2g}"


def _time(time_ns: float) -> str:
    for unit, factor in (("ms", 1e6), ("µs", 1e3)):
        if time_ns >= factor:
            return f"{time_ns / factor:.3g} {unit}"
    return f"{time_ns:.3g} ns"


def _simulation(result: Result) -> TextTable:
    title = "Simulation of a charge in lock step, with protection and recording"
    headings = ("bus", "x real time", "quartiles", "processor", "periods", "parties")
    table = TextTable(*headings, title=title)
    for speed in result.simulation:
        quartiles = speed.times_real_time
        if quartiles is not None:
            table.add_row(
                speed.bus,
                f"{quartiles.median:.0f}",
                f"{quartiles.low:.0f} .. {quartiles.high:.0f}",
                f"{speed.processor_share_percent:.0f} %",
                f"{quartiles.repetitions} x {speed.periods}",
                speed.parties,
            )
    return table


def _layers(result: Result) -> TextTable:
    speeds = [speed for speed in result.simulation if speed.layer_shares_percent]
    title = "What the plant's process spends that time on, in %"
    table = TextTable("", *(speed.bus for speed in speeds), title=title)
    names = dict.fromkeys(name for speed in speeds for name in speed.layer_shares_percent)
    for name in names:
        shares = [speed.layer_shares_percent.get(name, 0.0) for speed in speeds]
        table.add_row(name, *(f"{share:.0f}" for share in shares))
    return table


def _campaign(result: Result) -> TextTable:
    table = TextTable(*_CAMPAIGN_HEADINGS, title="Campaign, each run with three controllers")
    for row, relative in zip(result.campaign, growth(result.campaign)):
        table.add_row(
            f"{row.runs}",
            f"{row.runs_per_s:.1f}",
            f"{relative:.2f} of the first",
            f"{row.wall_time_s:.1f} s",
            f"{row.jobs}",
        )
    return table


def _board(result: Result) -> TextTable:
    headings = ("estimate and decision, worst", "control period, median", "application", "image")
    table = TextTable("", *headings, title="Boards: instructions in a charge, bytes of flash")
    for row in result.board:
        figures = (
            row.estimate_and_decision_worst,
            row.period_median,
            row.application_flash_B,
            row.image_flash_B,
        )
        table.add_row(row.board, *("" if value is None else f"{value:,}" for value in figures))
    return table


def print_limits(console: Console, result: Result) -> None:
    """What the figures are made of, and the aims of all that was run."""
    if result.period_not_counted:
        console.print(f"not counted: {result.period_not_counted}", soft_wrap=True, markup=False)
    for breakdown in breakdowns(result):
        print_breakdown(console, breakdown)
    if any(True for _ in aims(result)):
        _aims(result).print(console)


def print_breakdown(console: Console, breakdown: Breakdown) -> None:
    """Its parts, their sum, and where the limit is."""
    title = f"{breakdown.figure}: what it is made of"
    table = TextTable(breakdown.unit, "", "%", title=title)
    digits = 0 if breakdown.measured >= 1000 else 1
    for name, value in breakdown.parts.items():
        table.add_row(name, f"{value:,.{digits}f}", f"{100.0 * value / breakdown.measured:.0f}")
    table.add_row("all", f"{breakdown.total:,.{digits}f}", "100")
    table.add_row("asked", f"{breakdown.wanted:,.{digits}f}", "")
    table.print(console)
    console.print(f"{breakdown.limit}.", soft_wrap=True, markup=False)


def _aims(result: Result) -> TextTable:
    table = TextTable("", "measured", "wanted", "", title="Aims")
    for aim in aims(result):
        sign = "at most" if aim.is_small_wanted else "at least"
        unit = " x" if aim.unit == "times" else f" {aim.unit}"
        table.add_row(
            aim.name,
            f"{aim.measured:,.0f}{unit}",
            f"{sign} {aim.wanted:,.0f}{unit}",
            "reached" if aim.is_reached else red("missed"),
        )
    return table
