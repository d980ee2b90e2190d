"""What readings the firmware believes, and how far they may be from what it expects of them."""

from __future__ import annotations

from typing import Any

from bms.presets import Preset

# Beyond these no sensor of a cell reads: an electrolyte is frozen below -50 degC and gone above
# 100 degC, and no plate cools a single cell with 40 W. Less than no cooling is the sensor's error.
_SENSOR_RANGES = {
    "surface_temperature_K": (223.0, 373.0),
    "coolant_temperature_K": (223.0, 373.0),
    "cooling_power_W": (-1.0, 40.0),
}

# A charger gives at most what is asked for; half as much again is a broken sensor.
_CURRENT_RANGE_FACTOR = 1.5

# Below 1.5 V a lithium cell is damaged and must not be charged. What is above the limit is
# over-voltage, a fault of its own, up to where no cell but a broken wire explains it.
_LOWEST_VOLTAGE_V, _VOLTAGE_HEADROOM_V = 1.5, 0.6

_DEVIATIONS = {
    # Many times the error of sensor and bus together (0.03 A); a growing current is one step of
    # the growth limit behind (0.23 A with 1C per second and 0.1 s).
    "current_deviation_A": 1.0,
    # The polarisation that the model leaves out, and its open-circuit voltage being that of
    # another age: some ten millivolts each at 10C; a wrong plug-in state of charge is more.
    "voltage_deviation_V": 0.2,
    # The constraint holds the limit itself; what is above is the sensor's error and a lag.
    "voltage_overshoot_V": 0.05,
    # As much as the error bound of any shipped model, with the sensor's error, several times.
    "temperature_overshoot_K": 2.0,
    # Below the coldest that the heat allows, a bound already: errors of sensor and prediction.
    "surface_deficit_K": 1.0,
}


def plausibility_fields(preset: Preset) -> dict[str, Any]:
    """Content of the calibration's plausibility_t as nested mapping, in the units of its names."""
    strongest_A = -_CURRENT_RANGE_FACTOR * preset.limits.reference_current_A
    ranges = {
        "current_A": (-strongest_A, strongest_A),
        "voltage_V": (_LOWEST_VOLTAGE_V, preset.limits.max_voltage_V + _VOLTAGE_HEADROOM_V),
        **_SENSOR_RANGES,
    }
    return {name: {"low": low, "high": high} for name, (low, high) in ranges.items()} | _DEVIATIONS
