"""What a run of the matrix leaves behind: JSON, JUnit XML and a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

from hil_sim.fault_matrix.runner import MatrixSettings
from hil_sim.fault_matrix.verdict import Verdict
from hil_sim.report.page import render_page


@dataclass(frozen=True)
class MatrixResult:
    """The verdicts of a run of the matrix."""

    settings: MatrixSettings
    verdicts: Sequence[Verdict]
    wall_time_s: float

    @property
    def red(self) -> list[Verdict]:
        """Rows that did not go as expected."""
        return [verdict for verdict in self.verdicts if not verdict.passed]

    @property
    def red_first(self) -> list[Verdict]:
        """All verdicts: what did not go as expected, what did, what does not apply."""
        return sorted(self.verdicts, key=lambda v: (v.passed, v.does_not_apply is not None))

    @property
    def not_applied(self) -> dict[str, list[str]]:
        """Names of the rows that do not apply, by the reason."""
        found: dict[str, list[str]] = {}
        for verdict in self.verdicts:
            if verdict.does_not_apply is not None:
                found.setdefault(verdict.does_not_apply, []).append(verdict.row.name)
        return found

    @property
    def sentence(self) -> str:
        """In one sentence, whether all rows went as expected."""
        if self.red:
            return f"{len(self.red)} of {len(self.verdicts)} rows are red"
        left_out = sum(map(len, self.not_applied.values()))
        applied = f"all {len(self.verdicts) - left_out} rows as expected"
        if left_out:
            applied += f", {left_out} do not apply"
        return f"{applied}, no limit of the plant crossed"


def expected_text(verdict: Verdict) -> str:
    """Expected reaction with its deadline in periods."""
    expect = verdict.row.expect
    if expect.deadline_periods is None:
        return expect.reaction
    return f"{expect.reaction} by {expect.deadline_periods}"


def latch_text(verdict: Verdict) -> str:
    """Expected fault with its deadline in periods."""
    expect = verdict.row.expect
    if expect.latches is None:
        return "none"
    return f"{expect.latches} by {expect.latch_deadline_periods}"


def matrix_json(result: MatrixResult) -> dict[str, Any]:
    """Plain mapping with the settings and a mapping for each row."""
    return {
        "preset": result.settings.preset.name,
        "bus": result.settings.bus,
        "seed": result.settings.seed,
        "rows": len(result.verdicts),
        "red": len(result.red),
        "wall_time_s": round(result.wall_time_s, 3),
        "results": [_row_json(verdict) for verdict in result.red_first],
    }


def _row_json(verdict: Verdict) -> dict[str, Any]:
    row = verdict.row
    return {
        "name": row.name,
        "kind": row.fault.kind,
        "where": row.fault.where,
        "reaction": row.expect.reaction,
        "deadline_periods": row.expect.deadline_periods,
        "latches": row.expect.latches,
        "latch_deadline_periods": row.expect.latch_deadline_periods,
        "first_zero_period": verdict.first_zero_period,
        "latched_period": verdict.latched_period,
        "latched": list(verdict.latched),
        "final_state": verdict.final_state,
        "final_current_A": verdict.final_current_A,
        "max_core_temperature_K": verdict.max_core_temperature_K,
        "max_surface_temperature_K": verdict.max_surface_temperature_K,
        "max_voltage_V": verdict.max_voltage_V,
        "passed": verdict.passed,
        "failures": list(verdict.failures),
        "does_not_apply": verdict.does_not_apply,
        "note": row.note,
    }


def matrix_junit(result: MatrixResult) -> str:
    """JUnit XML with a test case for each row."""
    suite = ElementTree.Element(
        "testsuite",
        name=f"fault-matrix.{result.settings.preset.name}",
        tests=str(len(result.verdicts)),
        failures=str(len(result.red)),
        errors="0",
        skipped=str(sum(map(len, result.not_applied.values()))),
        time=f"{result.wall_time_s:.3f}",
    )
    for verdict in result.verdicts:
        case = ElementTree.SubElement(
            suite,
            "testcase",
            classname=f"fault-matrix.{verdict.row.fault.kind}",
            name=verdict.row.name,
            time=f"{verdict.wall_time_s:.3f}",
        )
        if not verdict.passed:
            failure = ElementTree.SubElement(case, "failure", message=verdict.failures[0])
            failure.text = "\n".join(verdict.failures)
        elif verdict.does_not_apply is not None:
            ElementTree.SubElement(case, "skipped", message=verdict.does_not_apply)
    suites = ElementTree.Element("testsuites")
    suites.append(suite)
    ElementTree.indent(suites)
    return ElementTree.tostring(suites, encoding="unicode", xml_declaration=True) + "\n"


def matrix_page(result: MatrixResult) -> str:
    """Self-contained HTML page with a row of the table for each verdict."""
    return render_page(
        "fault_matrix.html.j2",
        result=result,
        settings=result.settings,
        preset=result.settings.preset,
        rows=[(v, expected_text(v), latch_text(v)) for v in result.red_first],
    )
