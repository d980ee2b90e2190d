"""The comparison as text: a row a start, a row a controller, and the same as CSV; predictions."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from statistics import median
from typing import Any

from bms.text_table import Cell, TextTable, red
from hil_sim.studies.charge_times.comparison import BOUNDS, LIMITS

UNITS = {"core": "K", "surface": "K", "voltage": "mV", "soc": ""}
_SCALES = {"voltage": 1000.0}


def starts_table(content: Mapping[str, Any]) -> TextTable:
    """Bounds, and of each controller the time in s and its ratio over both; red: a limit crossed.

    `content` is that of comparison.content_json.
    """
    titles = [one["title"] for one in content["controllers"].values()]
    table = TextTable(
        "start", "physics' bound s", "with ramp and map s", *titles,
        title="time to full in s, over physics' bound, over the bound with ramp and map; "
        "!: a limit was crossed",
    )  # fmt: skip
    for row in content["starts"]:
        cells: list[Cell] = [_charge_cell(charge) for charge in row["charges"]]
        bounds = [f"{row[bound]:.1f}" for bound in BOUNDS]
        table.add_row(start_text(row), *bounds, *cells)
    return table


def controllers_table(content: Mapping[str, Any]) -> TextTable:
    """Median and worst of each controller, and what it crossed."""
    table = TextTable(*CONTROLLER_HEADINGS, title="over all starts")
    for figures in content["controllers"].values():
        texts = controller_cells(figures)
        table.add_row(*(red(text) if " by " in text else text for text in texts))
    return table


CONTROLLER_HEADINGS = (
    "controller",
    "full",
    "over physics: median",
    "worst",
    "over ramp and map: median",
    "worst",
    "core crossed",
    "surface crossed",
    "voltage crossed",
    "SoC crossed",
    "peak core",
    "mean core",
    "heat",
)


def controller_cells(figures: Mapping[str, Any]) -> list[str]:
    """Texts below CONTROLLER_HEADINGS; the last three are medians."""
    ratios = [
        ratio_text(figures[f"over_{bound}"][kind]) for bound in BOUNDS for kind in _MEDIAN_WORST
    ]
    crossed = [crossed_text(limit, **figures["crossed"][limit]) for limit in LIMITS]
    return [
        figures["title"],
        f"{figures['full']} of {figures['charges']}",
        *ratios,
        *crossed,
        f"{figures['median_max_core_temperature_K']:.2f} K",
        f"{figures['median_mean_core_temperature_K']:.2f} K",
        f"{figures['median_heat_J']:.0f} J",
    ]


_MEDIAN_WORST = ("median", "worst")


def ratio_text(ratio: float | None) -> str:
    """A ratio with three digits; a dash where the cell did not become full."""
    return "–" if ratio is None else f"{ratio:.3f}"


def crossed_text(limit: str, charges: int, most: float) -> str:
    """In how many charges a limit was crossed, and by how much at most."""
    if charges == 0:
        return "0"
    return f"{charges} by {most * _SCALES.get(limit, 1.0):.2g} {UNITS[limit]}".rstrip()


def start_text(row: Mapping[str, Any]) -> str:
    """A start of the JSON as the first cell of its row."""
    cooling = "" if row["cooling_share"] == 1.0 else f", {row['cooling_share']:g} x cooling"
    return f"{row['preset']} {row['temperature_K']:g} K, {row['soc']:g}{cooling}"


def crossed_limits(charge: Mapping[str, Any]) -> list[str]:
    """The limits that a charge of the JSON crossed."""
    return [
        limit
        for limit, name in zip(
            LIMITS, ("core_over_K", "surface_over_K", "voltage_over_V", "soc_over")
        )
        if charge[name] > 0.0
    ]


def _charge_cell(charge: Mapping[str, Any]) -> Cell:
    mark = "!" if crossed_limits(charge) else ""
    if charge["charge_time_s"] is None:
        text = f"– {charge['stop_reason']}{mark}"
    else:
        ratios = " ".join(ratio_text(charge[f"over_{bound}"]) for bound in BOUNDS)
        text = f"{charge['charge_time_s']:.1f} {ratios}{mark}"
    return red(text) if mark else text


def csv_text(content: Mapping[str, Any]) -> str:
    """One line a charge."""
    text = io.StringIO()
    start_names = ("preset", "temperature_K", "soc", "cooling_share", *BOUNDS)
    charge_names = list(content["starts"][0]["charges"][0])
    writer = csv.DictWriter(text, [*start_names, *charge_names], lineterminator="\n")
    writer.writeheader()
    for row in content["starts"]:
        start = {name: row[name] for name in start_names}
        writer.writerows(start | charge for charge in row["charges"])
    return text.getvalue()


PREDICTION_HEADINGS = ("start", "full after", "worst error of what is left", "within 5 %")


def prediction_cells(row: Mapping[str, Any]) -> list[str]:
    """A start of prediction.prediction_json below PREDICTION_HEADINGS."""
    time_s, error = row["charge_time_s"], row["worst_error"]
    return [
        start_text(row),
        "–" if time_s is None else f"{time_s:.1f} s",
        "–" if error is None else f"{100.0 * error:.1f} %",
        "yes" if row["came_true"] else "no",
    ]


def prediction_table(content: Mapping[str, Any]) -> TextTable:
    """The worst predicted time to full of each fastest charge."""
    table = TextTable(
        *PREDICTION_HEADINGS, title="predicted time to full, from the second minute on"
    )
    for row in content["starts"]:
        table.add_row(*prediction_cells(row))
    return table


ASKED_HEADINGS = (
    "asked for, over physics' bound",
    "charges",
    "in reach",
    "worst error of those",
    "kept, and cooler than the fastest",
    "cooler by, median",
)


def asked_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """A row below ASKED_HEADINGS for each time that was asked for."""
    asked = [one for row in content["starts"] for one in row["asked"]]
    rows = []
    for over in dict.fromkeys(one["over_optimum"] for one in asked):
        own = [one for one in asked if one["over_optimum"] == over]
        reached = [one for one in own if one["is_in_reach"]]
        errors = [
            float("inf")
            if one["charge_time_s"] is None
            else abs(one["charge_time_s"] / one["asked_s"] - 1.0)
            for one in reached
        ]
        cooler_K = [
            one["fastest_max_core_temperature_K"] - one["max_core_temperature_K"] for one in reached
        ]
        rows.append(
            [
                f"{over:.2f}",
                str(len(own)),
                str(len(reached)),
                f"{100.0 * max(errors):.2f} %" if errors else "–",
                str(sum(one["is_met"] for one in reached)),
                f"{median(cooler_K):.2f} K" if cooler_K else "–",
            ]
        )
    return rows


def asked_table(content: Mapping[str, Any]) -> TextTable:
    """Times that were asked for, and whether they were kept."""
    table = TextTable(*ASKED_HEADINGS, title="full by a time")
    for row in asked_rows(content):
        table.add_row(*row)
    return table


FAMILY_HEADINGS = ("of the cells of a family", "median", "worst")


FAMILY_RATIOS = (
    ("full", "by physics alone", "full_after_s_over_optimum_time_s"),
    ("full", "with ramp and map", "full_after_s_over_bound_s"),
    ("said to be full", "by physics alone", "charge_time_s_over_optimum_time_s"),
    ("said to be full", "with ramp and map", "charge_time_s_over_bound_s"),
)


def family_rows(content: Mapping[str, Any]) -> list[list[str]]:
    """Rows below FAMILY_HEADINGS."""
    errors = [row["worst_error"] for row in content["charges"] if row["worst_error"] is not None]
    return [
        *(
            [f"{when}, over the cell's bound {of}", *map(ratio_text, content[key].values())]
            for when, of, key in FAMILY_RATIOS
        ),
        [
            "worst error of what is left, over the time of the charge",
            *(f"{100.0 * error:.0f} %" for error in (median(errors), max(errors))),
        ]
        if errors
        else ["worst error of what is left, over the time of the charge", "–", "–"],
        ["unsafe or not complete", f"{content['unsafe']} of {content['cells']}", ""],
        ["predicted within 20 %", f"{content['came_true']} of {content['cells']}", ""],
    ]


def family_table(content: Mapping[str, Any]) -> TextTable:
    """What the drawn cells come to."""
    table = TextTable(*FAMILY_HEADINGS, title=f"{content['preset']}, {content['cells']} cells")
    for row in family_rows(content):
        table.add_row(*row)
    return table
