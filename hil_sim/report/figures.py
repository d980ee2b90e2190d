"""The figures of a run that a reader compares with limits and with other runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from bms.presets.schema import Limits
from hil_sim.run.result import CHARGING_STATES, RunResult, Summary


class Figure(NamedTuple):
    """One row: what, one text for each run, the limit as text, and for each run whether kept.

    `bound` is the least that is possible whatever controls the charge, empty where none is known.
    """

    name: str
    values: list[str]
    limit: str
    kept: list[bool | None]
    bound: str = ""


def figures(limits: Limits, results: list[RunResult]) -> list[Figure]:
    """Rows of the table, limits first."""
    summaries = [result.summary for result in results]
    rows = [
        _limited(
            "Peak core temperature",
            "max_core_temperature_K",
            limits.max_core_temperature_K,
            "{:.2f} K",
            summaries,
        ),
        _limited(
            "Peak surface temperature",
            "max_surface_temperature_K",
            limits.max_surface_temperature_K,
            "{:.2f} K",
            summaries,
        ),
        _limited("Peak voltage", "max_voltage_V", limits.max_voltage_V, "{:.3f} V", summaries),
        _limited("Peak state of charge", "max_soc", limits.max_soc, "{:.4f}", summaries),
    ]
    free = (
        ("State of charge at the end", "final_soc", "{:.4f}"),
        ("Charging time", "charge_time_s", "{:.1f} s"),
        ("First derating after", "first_derate_s", "{:.1f} s"),
        ("Mean core temperature", "mean_core_temperature_K", "{:.2f} K"),
        ("Heat produced", "heat_J", "{:.0f} J"),
        ("Core estimate: RMS error", "kan_rmse_K", "{:.4f} K"),
        ("Core estimate: largest error", "kan_max_abs_error_K", "{:.3f} K"),
        ("Core estimate: error bound", "error_bound_K", "{:.3f} K"),
        ("Control periods", "steps", "{}"),
        ("Control periods without safe current", "infeasible_steps", "{}"),
        ("End of the run", "stop_reason", "{}"),
        ("Wall-clock time", "wall_time_s", "{:.2f} s"),
    )
    for name, key, pattern in free:
        values = [_text(getattr(summary, key), pattern) for summary in summaries]
        rows.append(Figure(name, values, "", [None] * len(values)))
        if key == "charge_time_s":
            rows[-1:] = _with_bounds(rows[-1], summaries)
    potentials_V = [summary.min_anode_potential_V for summary in summaries]
    if any(potential_V is not None for potential_V in potentials_V):
        texts = [_text(potential_V, "{:.4f} V") for potential_V in potentials_V]
        rows.append(Figure("Least anode potential", texts, "", [None] * len(texts)))
    losses = [summary.line_losses for summary in summaries]
    if any(loss is not None for loss in losses):
        texts = [_text(None if loss is None else loss.total, "{}") for loss in losses]
        kept = [None if loss is None else loss.total == 0 for loss in losses]
        rows.append(Figure("Frames lost on the serial line", texts, "0", kept))
    return rows


def has_bound(rows: Sequence[Figure]) -> bool:
    """Whether a table of these rows needs a column for bounds."""
    return any(row.bound for row in rows)


def _with_bounds(time: Figure, summaries: list[Summary]) -> list[Figure]:
    """The row of the charging times, and how far each is from what no controller can beat."""
    rows = [time]
    for name, bound, ratio in (
        ("  over the bound of physics", "optimum_time_s", "time_over_optimum"),
        ("  over the bound with ramp and map", "lower_bound_s", "time_over_bound"),
    ):
        bounds_s = [getattr(summary, bound) for summary in summaries]
        known_s = next((bound_s for bound_s in bounds_s if bound_s is not None), None)
        if known_s is not None:
            texts = [_text(getattr(summary, ratio), "{:.3f}") for summary in summaries]
            rows.append(Figure(name, texts, "", [None] * len(texts), f"{known_s:.1f} s"))
    if len(rows) > 1:
        rows[0] = time._replace(bound=rows[1].bound)
    return rows


def _limited(name: str, key: str, limit: float, pattern: str, summaries: list[Summary]) -> Figure:
    values = [float(getattr(summary, key)) for summary in summaries]
    return Figure(
        name,
        [pattern.format(value) for value in values],
        pattern.format(limit),
        [value <= limit for value in values],
    )


def _text(value: object, pattern: str) -> str:
    return "–" if value is None else pattern.format(value)


def seconds_by_constraint(result: RunResult, period_s: float) -> dict[str, float]:
    """Time in s of the charge during which each constraint decided the current."""
    charging = [
        active
        for state, active in zip(result.series.state, result.series.active_constraint)
        if state in CHARGING_STATES and active is not None
    ]
    return {name: charging.count(name) * period_s for name in dict.fromkeys(charging)}
