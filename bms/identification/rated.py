"""Rated limits of a cell: of its data sheet, else what recordings have shown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bms.data.cycler import ZERO_CELSIUS_K, CyclerRecording
from bms.errors import InputError

KEYS = {
    "max_charge_A": "strongest charging current, A",
    "max_voltage_V": "end-of-charge voltage, V",
    "charge_temperature_degC": "range in which the cell may be charged, as 0..50",
    "max_core_temperature_degC": "limit of the core; the warm end of the range without it",
    "life_resistance": "factor on the resistance at the end of life",
    "life_capacity": "share of the capacity at the end of life",
}
_GIVEN, _SEEN = "data sheet (--rated)", "not given (--rated): what the recordings have shown"
_SHORTEST_CHARGE_S = 5.0


@dataclass(frozen=True)
class RatedLimits:
    """Limits and by name of KEYS where each comes from."""

    max_charge_A: float
    max_voltage_V: float
    coldest_K: float
    warmest_K: float
    max_core_K: float
    life_resistance: float
    life_capacity: float
    sources: dict[str, str]


def parse_rated(texts: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Numbers by key of texts such as max_charge_A=4 and charge_temperature_degC=0..50."""
    found: dict[str, tuple[float, ...]] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or key not in KEYS:
            raise InputError(
                f"--rated {text}: '{key}' is not one of {', '.join(KEYS)}; example: max_charge_A=4"
            )
        try:
            numbers = tuple(float(part) for part in value.split(".."))
        except ValueError:
            numbers = ()
        wanted = 2 if key == "charge_temperature_degC" else 1
        if len(numbers) != wanted or not all(math.isfinite(number) for number in numbers):
            raise InputError(f"--rated {text}: needs {KEYS[key]}")
        if (wanted == 2 and not numbers[0] < numbers[1]) or (wanted == 1 and not numbers[0] > 0.0):
            raise InputError(f"--rated {text}: {KEYS[key]} must rise, other values be above 0")
        found[key] = numbers
    return found


def rated_limits(
    given: dict[str, tuple[float, ...]], recordings: Sequence[CyclerRecording]
) -> RatedLimits:
    """The limits; what is not given is the most that a recording has shown, never more.

    InputError where no recording charges and no charging current is given.
    """
    sources = {key: _GIVEN for key in given}

    def one(key: str, seen: float) -> float:
        if key in given:
            return given[key][0]
        sources[key] = _SEEN
        return seen

    charging_A = max(_sustained_charge_A(recording) for recording in recordings)
    if "max_charge_A" not in given and charging_A == 0.0:
        raise InputError(
            f"{recordings[0].path}: no recording charges the cell, so nothing tells how strongly "
            "it may be charged; give --rated max_charge_A=AMPERE of its data sheet"
        )
    warm = [r.surface_K for r in recordings if r.surface_K is not None]
    if "charge_temperature_degC" in given:
        coldest_C, warmest_C = given["charge_temperature_degC"]
        coldest_K, warmest_K = coldest_C + ZERO_CELSIUS_K, warmest_C + ZERO_CELSIUS_K
    elif warm:
        sources["charge_temperature_degC"] = _SEEN
        coldest_K = float(np.floor(min(values.min() for values in warm)))
        warmest_K = float(np.floor(max(values.max() for values in warm)))
    else:
        raise InputError(
            f"{recordings[0].path}: no temperature was recorded; give "
            "--rated charge_temperature_degC=LOW..HIGH of the data sheet"
        )
    core_C = one("max_core_temperature_degC", warmest_K - ZERO_CELSIUS_K)
    if "max_core_temperature_degC" not in given:
        sources["max_core_temperature_degC"] = "the warm end of charge_temperature_degC"
    for key in ("life_resistance", "life_capacity"):
        sources.setdefault(key, "assumed: a usual end of life")
    return RatedLimits(
        one("max_charge_A", _floor(charging_A)),
        one("max_voltage_V", _floor(max(float(r.voltage_V.max()) for r in recordings))),
        coldest_K,
        warmest_K,
        core_C + ZERO_CELSIUS_K,
        given.get("life_resistance", (1.5,))[0],
        given.get("life_capacity", (0.8,))[0],
        sources,
    )


def _sustained_charge_A(recording: CyclerRecording) -> float:
    """Strongest mean charging current over 5 s of a recording, or 0."""
    charged_As = -recording.charge_out_As
    later = np.searchsorted(recording.time_s, recording.time_s + _SHORTEST_CHARGE_S)
    inside = later < len(recording.time_s)
    rows = np.flatnonzero(inside)
    if len(rows) == 0:
        return 0.0
    span_s = recording.time_s[later[rows]] - recording.time_s[rows]
    mean_A = (charged_As[later[rows]] - charged_As[rows]) / span_s
    strongest_A = float(np.max(mean_A))
    noise_A = 0.01 * float(np.max(np.abs(recording.current_A)))
    return strongest_A if strongest_A > noise_A else 0.0


def _floor(value: float) -> float:
    """Three significant figures, rounded down; 0 of 0."""
    if value <= 0.0:
        return 0.0
    digits = 2 - math.floor(math.log10(value))
    return float(math.floor(value * 10.0**digits) / 10.0**digits)
