"""Recordings in the wrong unit or with the wrong sign are refused before anything learns from them.

A limit lies where no cell goes, and far enough from real recordings that none is refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from bms.arrays import Array
from bms.errors import InputError

_COLDEST_K, _HOTTEST_K = 200.0, 500.0
"""Electrolytes freeze above the one, separators melt below the other."""
_HOTTEST_AS_CELSIUS = 180.0
_MOST_CURRENT_A = 1000.0
_MOST_CHARGE_AH = 1000.0
"""Moved one way in a recording: more than the largest cells hold."""
_MOST_COOLING_W = 1e4
_LONGEST_STEP_S = 60.0
"""Median; a cell's temperatures follow in seconds to minutes, which longer steps cannot show."""
_SHORTEST_STEP_S = 5e-4
_LONGEST_RECORDING_S = 14 * 86400.0
_MOST_VOLTAGE_V = 1000.0
_LEAST_RESISTANCE_OHM = 5e-5
"""Cells of 300 Ah have three times as much."""
_SHARE_OF_A_STEP = 0.2
"""Of the range of the current; slower changes are those of a charger that holds the voltage."""
_LEAST_ANSWER_V = 2e-3
_CLEAR = 0.5
"""Cosine of the changes of voltage and current."""
_LEAST_SWING_V = 0.1
_CLEAR_TREND = 0.9


def require_plausible(where: str, columns: Mapping[str, Array], voltage_V: Array | None) -> None:
    """Raise InputError, in one line with column, value and likely cause, for an implausible one.

    `columns` are some of a recording's, each (N,); `voltage_V` (N,) is NaN where there is none.
    The sign of the current can be told only with a voltage: charging, negative, raises it.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        complaint = next(_complaints(columns, voltage_V), None)
    if complaint is not None:
        raise InputError(f"{where}: {complaint}")


def _complaints(columns: Mapping[str, Array], voltage_V: Array | None) -> Iterator[str]:
    yield from _temperatures(columns)
    yield from _time(columns["time_s"])
    if "cooling_power_W" in columns:
        worst_W = _largest(columns["cooling_power_W"])
        if abs(worst_W) > _MOST_COOLING_W:
            yield f"cooling_power_W: {worst_W:.6g} W is beyond any cell's cooling; likely milliwatt"
    if "current_A" not in columns:
        return
    yield from _current(columns["time_s"], columns["current_A"])
    if voltage_V is not None:
        measured = np.isfinite(voltage_V)
        if np.any(measured):
            time_s, current_A = columns["time_s"][measured], columns["current_A"][measured]
            yield from _voltage(time_s, current_A, voltage_V[measured])


def _temperatures(columns: Mapping[str, Array]) -> Iterator[str]:
    wrong = {
        name: values
        for name, values in columns.items()
        if name.endswith("_temperature_K")
        and not (values.min() >= _COLDEST_K and values.max() <= _HOTTEST_K)
    }
    if not wrong:
        return
    names = ", ".join(wrong)
    values = next(iter(wrong.values()))
    middle = float(np.median(values))
    if -_COLDEST_K / 2 < middle < _HOTTEST_AS_CELSIUS:
        yield f"{names}: median {middle:.6g} K; likely degrees Celsius: add 273.15"
        return
    outer = values[(values < _COLDEST_K) | (values > _HOTTEST_K)]
    cause = (
        "a fault of the sensor: remove its rows"
        if _COLDEST_K <= middle <= _HOTTEST_K
        else "another unit than kelvin: convert it"
    )
    yield f"{names}: {outer[0]:.6g} K is no temperature of a cell; likely {cause}"


def _time(time_s: Array) -> Iterator[str]:
    if len(time_s) < 2:
        return
    step_s, duration_s = float(np.median(np.diff(time_s))), float(time_s[-1] - time_s[0])
    if step_s > _LONGEST_STEP_S:
        yield (
            f"time_s: median step {step_s:.6g} s, too long to show how a cell warms; "
            "likely milliseconds: divide by 1000"
        )
    if duration_s > _LONGEST_RECORDING_S:
        yield (
            f"time_s: {duration_s:.6g} s, {duration_s / 86400.0:.0f} days in all; "
            "likely milliseconds: divide by 1000"
        )
    if step_s < _SHORTEST_STEP_S:
        yield f"time_s: median step {step_s:.3g} s; likely hours: multiply by 3600"


def _current(time_s: Array, current_A: Array) -> Iterator[str]:
    worst_A = _largest(current_A)
    if abs(worst_A) > _MOST_CURRENT_A:
        yield (f"current_A: {worst_A:.6g} A is beyond any cell; likely milliampere: divide by 1000")
    charge_Ah = float(np.ptp(_charge_As(time_s, current_A))) / 3600.0
    if charge_Ah > _MOST_CHARGE_AH:
        yield (
            f"current_A: moves {charge_Ah:.6g} Ah one way, more than any cell holds; "
            "likely milliampere, or time_s in milliseconds: divide by 1000"
        )


def _voltage(time_s: Array, current_A: Array, voltage_V: Array) -> Iterator[str]:
    middle_V = float(np.median(voltage_V))
    if middle_V > _MOST_VOLTAGE_V:
        yield f"voltage_V: median {middle_V:.6g} V; likely millivolt: divide by 1000"
    if middle_V <= 0.0:
        yield f"voltage_V: median {middle_V:.6g} V is no voltage of a cell; likely another column"
    turned = "likely positive while charging: multiply it by -1"
    change_A, change_V = np.diff(current_A), np.diff(voltage_V)
    steps = np.abs(change_A) > _SHARE_OF_A_STEP * np.ptp(current_A)
    steps_A, steps_V = change_A[steps], change_V[steps]
    if len(steps_A) and np.sqrt(np.mean(steps_V**2)) > _LEAST_ANSWER_V:
        cosine = float(steps_A @ steps_V / np.sqrt((steps_A @ steps_A) * (steps_V @ steps_V)))
        slope_ohm = float(steps_A @ steps_V / (steps_A @ steps_A))
        if cosine > _CLEAR:
            yield (
                f"current_A: voltage_V moves with it by {1e3 * slope_ohm:+.3g} mV for each "
                f"ampere, where a cell's moves against it; {turned}"
            )
        elif cosine < -_CLEAR and -slope_ohm < _LEAST_RESISTANCE_OHM:
            yield (
                f"current_A: voltage_V answers it as a cell of {-1e3 * slope_ohm:.3g} mohm; "
                "likely milliampere: divide by 1000"
            )
        return
    # Without a step only a long charge or discharge tells.
    has_one_sign = np.all(current_A < 0.0) or np.all(current_A > 0.0)
    if has_one_sign and len(voltage_V) > 2 and np.ptp(voltage_V) > _LEAST_SWING_V:
        trend = float(np.corrcoef(_charge_As(time_s, current_A), voltage_V)[0, 1])
        if trend > _CLEAR_TREND:
            yield (
                f"current_A: median {np.median(current_A):.6g} A while voltage_V goes from "
                f"{voltage_V[0]:.5g} to {voltage_V[-1]:.5g} V; {turned}"
            )


def _charge_As(time_s: Array, current_A: Array) -> Array:
    """Charge taken out since the beginning, (N,); each current flows until the next row."""
    return np.concatenate([[0.0], np.cumsum(current_A[:-1] * np.diff(time_s))])


def _largest(values: Array) -> float:
    return float(values[np.argmax(np.abs(values))])
