"""Writes a reproduction: reproduce.json, reproduce.csv, pictures and report.html."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from typing import Any, NamedTuple

from bms.presets import Preset
from hil_sim.report.chart import charge_chart, estimate_chart
from hil_sim.report.folder import OutputFolder
from hil_sim.report.page import data_url, render_page
from hil_sim.run.result import Summary
from hil_sim.run.settings import ControllerKind
from hil_sim.studies.reproduction.comparison import compare_with_paper
from hil_sim.studies.reproduction.runs import DISTURBANCES, Case, Results
from hil_sim.studies.reproduction.sections import BAD, passed, sections

CAUTION = (
    "The cell of the preset paper_calibrated is fitted to the paper's figures, because the paper's "
    "own parameters are not published: agreement shows that the model can reach them, and predicts "
    "nothing. The preset lin2014 is fitted to nothing."
)
_FIGURES = (
    "max_core_temperature_K",
    "max_surface_temperature_K",
    "max_voltage_V",
    "max_soc",
    "final_soc",
    "charge_time_s",
    "first_derate_s",
    "kan_rmse_K",
    "kan_max_abs_error_K",
    "error_bound_K",
    "infeasible_steps",
    "limits_kept",
    "stop_reason",
)


class Picture(NamedTuple):
    """A chart with the name of its file."""

    file_name: str
    caption: str
    png: bytes


def content_json(presets: Sequence[Preset], results: Results, seed: int) -> dict[str, Any]:
    """Everything as plain values; the same for the same seed, whatever the machine."""
    return {
        "seed": seed,
        "passed": passed(results),
        "caution": CAUTION,
        "disturbances": [noise.value for noise in DISTURBANCES],
        "presets": {
            preset.name: {
                "comparison": [
                    {
                        "figure": row.name,
                        "unit": row.unit,
                        "paper": row.paper,
                        "ours": list(row.ours),
                        "difference": row.difference,
                        "tolerance": row.tolerance,
                        "within": row.within,
                        "likely_cause": row.cause,
                    }
                    for row in compare_with_paper(preset, results)
                ],
                "notes": [note for section in sections(preset, results) for note in section.notes],
                "runs": [row for row in _rows(results) if row["preset"] == preset.name],
            }
            for preset in presets
        },
    }


def _rows(results: Results) -> list[dict[str, Any]]:
    return [
        {
            "preset": case.preset,
            "controller": case.controller.value,
            "disturbance": case.disturbance.value,
            "without_margin": case.without.name if case.without else None,
            **_figures(result.summary),
        }
        for case, result in results.items()
    ]


def _figures(summary: Summary) -> dict[str, Any]:
    return {name: getattr(summary, name) for name in _FIGURES}


def runs_csv(results: Results) -> str:
    """One row a charge; an empty field stands for a figure that there is not."""
    rows = _rows(results)
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def pictures(preset: Preset, results: Results) -> list[Picture]:
    """The paper's two figures, and the first of them with every controller."""
    limits = preset.limits
    runs = {kind: results[Case(preset.name, kind)] for kind in ControllerKind}
    pair = [runs[ControllerKind.KAN_RCBF], runs[ControllerKind.S_CBF]]
    return [
        Picture(
            f"comparison-{preset.name}.png",
            "KAN-rCBF and S-CBF, as in the paper's comparison",
            charge_chart(limits, pair),
        ),
        Picture(
            f"estimate-{preset.name}.png",
            "core temperature, its estimate and the error within its bound",
            estimate_chart(pair[0]),
        ),
        Picture(
            f"controllers-{preset.name}.png",
            "every controller",
            charge_chart(limits, list(runs.values())),
        ),
    ]


def write_reproduction(
    folder: OutputFolder, presets: Sequence[Preset], results: Results, seed: int
) -> None:
    """Write every file into the folder."""
    parts = []
    for preset in presets:
        drawn = pictures(preset, results)
        for picture in drawn:
            folder.path(picture.file_name).write_bytes(picture.png)
        parts.append(
            {
                "preset": preset.name,
                "sections": sections(preset, results),
                "pictures": [{"caption": p.caption, "url": data_url(p.png)} for p in drawn],
            }
        )
    content = json.dumps(content_json(presets, results, seed), indent=2) + "\n"
    page = render_page(
        "reproduction.html.j2",
        seed=seed,
        caution=CAUTION,
        passed=passed(results),
        parts=parts,
        bad=BAD,
    )
    folder.path("reproduce.json").write_text(content, encoding="utf-8")
    folder.path("reproduce.csv").write_text(runs_csv(results), encoding="utf-8")
    folder.path("report.html").write_text(page, encoding="utf-8")
