"""Writes the files of a run: summary.json, charge.png, report.html (can.log grows meanwhile)."""

from __future__ import annotations

import json
from typing import Any

from hil_sim.report.chart import charge_chart, estimate_chart
from hil_sim.report.figures import figures, has_bound, seconds_by_constraint
from hil_sim.report.folder import OutputFolder
from hil_sim.report.page import data_url, render_page
from hil_sim.report.timing import timing_chart, timing_figures
from hil_sim.run.result import RunResult
from hil_sim.run.settings import Settings


def summary_json(results: list[RunResult]) -> dict[str, Any]:
    """Summary of the controller, with that of the first baseline under `baseline`.

    Of several baselines, all stand under `baselines`, by the names of their runs.
    """
    first, *baselines = (result.summary for result in results)
    content = first.to_json()
    if baselines:
        content["baseline"] = baselines[0].to_json()
    if len(baselines) > 1:
        content["baselines"] = {summary.name: summary.to_json() for summary in baselines}
    return content


def write_report(folder: OutputFolder, settings: Settings, results: list[RunResult]) -> None:
    """Write summary, chart and page of a controller and the baselines beside it."""
    bound_s = results[0].summary.optimum_time_s
    chart = charge_chart(settings.preset.limits, results, bound_s)
    folder.path("charge.png").write_bytes(chart)
    text = json.dumps(summary_json(results), indent=2) + "\n"
    folder.path("summary.json").write_text(text, encoding="utf-8")
    page = report_page(settings, results, chart)
    folder.path("report.html").write_text(page, encoding="utf-8")


def report_page(settings: Settings, results: list[RunResult], chart: bytes) -> str:
    """The self-contained HTML page of a run."""
    preset, first = settings.preset, results[0].summary
    lines = figures(preset.limits, results)
    has_estimate = first.kan_rmse_K is not None
    return render_page(
        "report.html.j2",
        settings=settings,
        preset=preset,
        results=results,
        first=first,
        figures=lines,
        is_bounded=has_bound(lines),
        deciding=[
            (result.summary.name, name, time_s)
            for result in results
            for name, time_s in seconds_by_constraint(
                result, preset.timing.sampling_period_s
            ).items()
        ],
        chart=data_url(chart),
        punctuality=timing_figures(results),
        timing_chart=None if results[0].watch is None else data_url(timing_chart(results[0].watch)),
        estimate_chart=data_url(estimate_chart(results[0])) if has_estimate else None,
    )
