"""What terminal and page both show: the same tables, as text."""

from __future__ import annotations

from dataclasses import dataclass

from bms.presets import Preset
from hil_sim.run.result import Summary
from hil_sim.run.settings import ControllerKind
from hil_sim.studies.reproduction.comparison import PaperComparison, compare_with_paper
from hil_sim.studies.reproduction.margins import EVERYTHING, MARGINS, OURS_TOGETHER
from hil_sim.studies.reproduction.runs import DISTURBANCES, Case, Results


@dataclass(frozen=True)
class Section:
    """A table with a title and sentences below it; a cell marked "!" at its end is a bad one."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


BAD = "!"


def sections(preset: Preset, results: Results) -> list[Section]:
    """The three tables of a preset: against the paper, all controllers, the margins' prices."""
    return [
        _paper_section(preset, results),
        _controller_section(preset, results),
        _margin_section(preset, results),
    ]


def _number(value: float | None, unit: str, sign: str = "") -> str:
    digits = {"s": 1, "K": 2, "V": 4, "error": 4}.get(unit, 3)
    return "–" if value is None else f"{value:{sign}.{digits}f}"


def _paper_section(preset: Preset, results: Results) -> Section:
    rows = compare_with_paper(preset, results)
    return Section(
        f"{preset.name}: the paper's figures beside ours",
        ("", "paper", *(noise.value for noise in DISTURBANCES), "none – paper", "target ±"),
        tuple(_paper_row(row) for row in rows),
        tuple(
            f"{row.name}: {_row_number(row, row.difference, '+')} {row.unit}".rstrip()
            + f"; likely cause: {row.cause}."
            for row in rows
            if row.difference is not None
        ),
    )


def _row_number(row: PaperComparison, value: float | None, sign: str = "") -> str:
    is_error = row.unit == "K" and row.paper < _LARGEST_ERROR_K
    return _number(value, "error" if is_error else row.unit, sign)


_LARGEST_ERROR_K = 1.0


def _paper_row(row: PaperComparison) -> tuple[str, ...]:
    ours = [_row_number(row, value) for value in row.ours]
    ours += [""] * (len(DISTURBANCES) - len(ours))
    target = "" if row.tolerance is None else _row_number(row, row.tolerance)
    difference = _row_number(row, row.difference, "+") + (BAD if row.within is False else "")
    name = f"{row.name}, {row.unit}" if row.unit else row.name
    return (name, _row_number(row, row.paper), *ours, difference, target)


def _controller_section(preset: Preset, results: Results) -> Section:
    rows = []
    for kind in ControllerKind:
        for noise in DISTURBANCES:
            summary = results[Case(preset.name, kind, noise)].summary
            name = kind.value if noise is DISTURBANCES[0] else ""
            rows.append((name, noise.value, *_charge_cells(summary, preset)))
    return Section(
        f"{preset.name}: every controller on the same cell, seed and sensors",
        ("controller", "disturbed by", *_CHARGE_COLUMNS),
        tuple(rows),
        (_kept_note(preset, results), _form_note(preset, results)),
    )


_PEAK_COLUMNS = ("core peak, K", "surface peak, K", "voltage peak, V")
_CHARGE_COLUMNS = (*_PEAK_COLUMNS, "time to full, s", "first derating, s")


def _charge_cells(summary: Summary, preset: Preset) -> tuple[str, ...]:
    limits = preset.limits
    peaks = (
        (summary.max_core_temperature_K, limits.max_core_temperature_K, "K"),
        (summary.max_surface_temperature_K, limits.max_surface_temperature_K, "K"),
        (summary.max_voltage_V, limits.max_voltage_V, "V"),
    )
    return (
        *(_number(peak, unit) + ("" if peak <= limit else BAD) for peak, limit, unit in peaks),
        _number(summary.charge_time_s, "s"),
        _number(summary.first_derate_s, "s"),
    )


def _kept_note(preset: Preset, results: Results) -> str:
    kept = [
        f"{kind.value} ({_number(runs[0].charge_time_s, 's')} s)"
        for kind in ControllerKind
        if (runs := [results[Case(preset.name, kind, noise)].summary for noise in DISTURBANCES])
        and all(run.passed for run in runs)
    ]
    return (
        f"Kept every limit under all disturbances: {', '.join(kept) or 'none'}. No baseline knows "
        "of the core limit: one that kept it owes that to this cell, this start and its settings."
    )


def _form_note(preset: Preset, results: Results) -> str:
    cascade, single = (
        results[Case(preset.name, kind)].summary
        for kind in (ControllerKind.S_CBF, ControllerKind.S_CBF_SINGLE_STEP)
    )
    core_K = single.max_core_temperature_K - cascade.max_core_temperature_K
    surface_K = single.max_surface_temperature_K - cascade.max_surface_temperature_K
    time_s = _saving_s(single, cascade)
    return (
        "S-CBF in one step, which regards reversible heat, against the cascade, which does not: "
        f"core peak {core_K:+.3f} K, surface peak {surface_K:+.3f} K, "
        f"time {_number(time_s, 's', '+')} s. The paper reports that both forms behave alike."
    )


def _saving_s(longer: Summary, shorter: Summary) -> float | None:
    if longer.charge_time_s is None or shorter.charge_time_s is None:
        return None
    return longer.charge_time_s - shorter.charge_time_s


def _margin_section(preset: Preset, results: Results) -> Section:
    whole = results[Case(preset.name)].summary
    rows, costs_s = [], {}
    for margin in MARGINS:
        summary = results[Case(preset.name, without=margin)].summary
        cost_s = costs_s[margin.name] = _saving_s(whole, summary)
        core_K, surface_K, voltage_V, time_s, _ = _charge_cells(summary, preset)
        origin = {OURS_TOGETHER: "ours", EVERYTHING: "both"}.get(
            margin.name, "paper" if margin.in_paper else "ours"
        )
        cells = (origin, _number(cost_s, "s", "+"), time_s, core_K, surface_K, voltage_V)
        rows.append((margin.name, *cells))
    return Section(
        f"{preset.name}: what each margin costs, one left out at a time, without disturbance",
        ("without the margin", "whose", "it costs, s", "time to full, s", *_PEAK_COLUMNS),
        tuple(rows),
        (_price_note(costs_s),),
    )


def _price_note(costs_s: dict[str, float | None]) -> str:
    known = {name: cost_s for name, cost_s in costs_s.items() if cost_s is not None}
    ours = {
        margin.name: known[margin.name]
        for margin in MARGINS
        if not margin.in_paper
        and margin.name in known
        and margin.name not in (OURS_TOGETHER, EVERYTHING)
    }
    if not ours or OURS_TOGETHER not in known:
        return "No charge came to its end without some margin."
    dearest = max(ours, key=ours.__getitem__)
    return (
        f"The margins that the paper does not have cost {known[OURS_TOGETHER]:+.1f} s together; "
        f"the dearest is '{dearest}' with {ours[dearest]:+.1f} s. Costs do not add up, because "
        "one constraint covers for another."
    )


def passed(results: Results) -> bool:
    """Whether the firmware with all its margins kept every limit in every charge."""
    return all(
        result.summary.passed
        for case, result in results.items()
        if case.controller is ControllerKind.KAN_RCBF and case.without is None
    )
