"""What `bms campaign` prints."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from bms.text_table import TextTable
from hil_sim.studies.campaign.rows import FIRMWARE


def print_classes(console: Console, summary: dict[str, Any]) -> None:
    """Tables of the cells inside and outside the modelled uncertainty."""
    for name, cells in summary["classes"].items():
        table = TextTable(
            *_HEADINGS,
            title=f"{cells['runs']} cells {name} the modelled uncertainty: runs that cross a limit",
        )
        for controller, figures in cells["controllers"].items():
            table.add_row(controller, *_cells(figures))
        table.print(console)
        if cells["estimate_beyond_error_bound"]:
            console.print(
                f"in {cells['estimate_beyond_error_bound']} of them the core estimate was wrong by "
                f"more than its bound of {summary['estimation_error_bound_K']:.3f} K"
            )


def print_family(console: Console, summary: dict[str, Any]) -> None:
    """Table of what went wrong with cells of the preset's family, and the firmware's worst runs."""
    table = TextTable(
        *_FAMILY_HEADINGS,
        title=f"{summary['runs']} cells of the preset's family: runs in which something went wrong",
    )
    for controller, figures in summary["controllers"].items():
        table.add_row(controller, *_family_cells(figures))
    table.print(console)
    console.print(
        "soc: true state of charge over 1.005; early: complete below 0.96; stops: runs with a stop "
        "to 0 A; done: complete in time; full: of a true 0.99 or more"
    )
    figures = summary["controllers"][FIRMWARE]
    for kind, violation in figures["violations"].items():
        for worst in violation["worst"]:
            console.print(f"{FIRMWARE} {kind}: run {worst['run']} by {worst['by']:.4g}")
    for fault, count in summary["first_faults"].items():
        console.print(f"{FIRMWARE}: first fault {fault} (monitor.h) in {count} runs")


_FAMILY_HEADINGS = (
    "",
    "core",
    "surf.",
    "volt.",
    "soc",
    "early",
    "fault",
    "stops",
    "done %",
    "full %",
    "time s",
)


def _family_cells(figures: dict[str, Any]) -> list[str]:
    times = figures["charge_time_s"]
    return [
        *(str(violation["count"]) for violation in figures["violations"].values()),
        str(figures["stops"]["runs"]),
        f"{100.0 * figures['complete']['share']:.2f}",
        f"{100.0 * figures['full']['share']:.2f}",
        "" if times is None else f"{times['median']:.0f}",
    ]


_COUNTS = ("core", "surf.", "volt.", "soc", "any")
_HEADINGS = ("", *_COUNTS, "any, 95 %", "peak K", "time s", "not full")


def _cells(figures: dict[str, Any]) -> list[str]:
    violations, times = figures["violations"], figures["charge_time_s"]
    anything, peak = violations["any"], figures["peaks"]["max_core_temperature_K"]
    ends = figures["outcomes"]
    return [
        *(str(violation["count"]) for violation in violations.values()),
        "" if anything["low"] is None else f"{anything['low']:.2g}..{anything['high']:.2g}",
        "" if peak is None else f"{peak['max']:.2f}",
        "" if times is None else f"{times['median']:.0f}",
        str(sum(ends.values()) - ends.get("complete", 0)),
    ]
