"""The comparison as text: a row a start, a row a controller, and the same as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
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
        for limit, name in zip(LIMITS, ("core_over_K", "surface_over_K", "voltage_over_V", "soc_over"))
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
