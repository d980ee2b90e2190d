"""What `bms verify` shows of a family of cells."""

from __future__ import annotations

from collections.abc import Mapping

from rich.console import Console

from bms.text_table import TextTable
from bms.verification.family import FamilyVerification


def print_family(result: FamilyVerification) -> None:
    """Relations that the argument needs, violations found, and what sensors could hide."""
    console = Console()
    table = TextTable("what the argument needs", "holds", "at least", "is")
    for relation in result.relations:
        table.add_row(
            relation.name,
            "yes" if relation.holds else "NO",
            f"{relation.needs:.5g}",
            f"{relation.has:.5g}",
        )
    table.print(console)
    for relation in result.relations:
        if not relation.holds:
            console.print(
                f"NOT certified: {relation.name} is {relation.has:.6g}, {relation.needs:.6g} is "
                f"needed{_at(relation.state)}; make the calibration anew from the preset"
            )
    for violation in result.violations:
        console.print(
            f"NOT certified: {violation.claim} by {violation.by:.3g}{_at(violation.state)}; "
            "report the preset: its constants should have covered this"
        )
    lies = TextTable("one wrong sensor, unseen", "by", "core over K", "voltage over V", "taken for")
    for lie in result.lies:
        lies.add_row(
            lie.sensor,
            f"{lie.lie:+.3g} {lie.unit}",
            f"{lie.core_excess_K:.2f}",
            f"{lie.voltage_excess_V:.3f}",
            lie.why,
        )
    lies.print(console)
    console.print(
        f"for a coolant of at most {result.coolant_up_to_K:.2f} K: beside a warmer one "
        "disturbances at their bounds can take a cell over a limit at 0 A, and a charge adds"
    )
    verdict = "certified" if result.certified else "NOT certified"
    console.print(
        f"{result.preset}: {verdict} for every cell of its family, {result.held_s:g} s from each "
        f"reading; {result.samples} simulated holds, {result.wall_time_s:.1f} s"
    )


def _at(state: Mapping[str, float]) -> str:
    if not state:
        return ""
    return " (at " + ", ".join(f"{name} {value:.6g}" for name, value in state.items()) + ")"
