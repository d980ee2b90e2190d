"""What a row of the matrix takes for granted of the preset, and why it says nothing of another.

A row that does not go as expected does not apply where one of its needs is not met. It has been
played all the same: that no limit of the plant is crossed is asked of every row.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

from bms.calibration.plausibility import plausibility_fields
from bms.presets import Preset
from hil_sim.bus.catalog import ActiveConstraint
from hil_sim.run.result import RunResult

Need = Literal[
    "known-cell", "temperature-limited", "time-to-fill", "strong-current", "growing-current"
]


def unmet(needs: tuple[Need, ...], preset: Preset, result: RunResult, onset: int) -> str | None:
    """Why a row with these needs does not apply to a run whose fault came in period `onset`."""
    reasons = (_REASONS[need](preset, result, onset) for need in needs)
    return next((reason for reason in reasons if reason is not None), None)


def unknown_cell(preset: Preset) -> str | None:
    """Why a row that takes a known cell for granted does not apply; None where it is known."""
    if preset.cell.interval is None:
        return None
    return (
        "the preset is a family of cells, for which a fault is what no cell, sensor or supply of "
        "it could read; the current is safe for all of them"
    )


def _known_cell(preset: Preset, result: RunResult, onset: int) -> str | None:
    return unknown_cell(preset)


def _temperature_limited(preset: Preset, result: RunResult, onset: int) -> str | None:
    series = result.series
    place = series.charge_period.index(onset) - 1
    constraint = series.active_constraint[place]
    if constraint in {ActiveConstraint.CORE.label, ActiveConstraint.SURFACE.label}:
        return None
    return (
        f"before the fault {-series.current_A[place]:.1f} A flow, which no temperature limits "
        f"with this preset (active constraint: {constraint})"
    )


def _time_to_fill(preset: Preset, result: RunResult, onset: int) -> str | None:
    series = result.series
    if series.soc[-1] >= preset.limits.completion_soc:
        return None
    return (
        f"with this preset the cell is {100.0 * series.soc[-1]:.0f} % full at the end of the run; "
        "that it is not overfilled says nothing yet"
    )


def _permitted_A(preset: Preset) -> float:
    """By how much the measured current may miss the command."""
    return float(plausibility_fields(preset)["current_deviation_A"])


def _strong_current(preset: Preset, result: RunResult, onset: int) -> str | None:
    series = result.series
    flowing_A = -series.current_A[series.charge_period.index(onset) - 1]
    permitted_A = _permitted_A(preset)
    if _SHARE * flowing_A >= 2.0 * permitted_A:
        return None
    return (
        f"before the fault {flowing_A:.1f} A flow, of which {_SHARE:.0%} are no clear deviation: "
        f"{permitted_A:g} A are permitted"
    )


def _growing_current(preset: Preset, result: RunResult, onset: int) -> str | None:
    growth_A = preset.limits.current_growth_A_per_s * preset.timing.sampling_period_s
    permitted_A = _permitted_A(preset)
    if _PERIODS * growth_A >= 2.0 * permitted_A:
        return None
    return (
        f"with this preset the current grows by {growth_A:.3g} A a period, so that the permitted "
        f"deviation of {permitted_A:g} A takes longer than {_PERIODS} periods"
    )


_SHARE = 0.2
"""Of the current, by which a charger of the matrix misses its command."""
_PERIODS = 10
"""Within which a current of the matrix that does not follow its command is found."""
_REASONS: dict[Need, Callable[[Preset, RunResult, int], str | None]] = {
    "known-cell": _known_cell,
    "temperature-limited": _temperature_limited,
    "time-to-fill": _time_to_fill,
    "strong-current": _strong_current,
    "growing-current": _growing_current,
}
assert set(_REASONS) == set(get_args(Need))
