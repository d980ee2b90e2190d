"""What readings the firmware believes, and how far they may be from what it expects of them.

The thresholds are the same for every preset. Each is many times what sensors, bus and model can err
by, so that none is crossed in a charge within the modelled uncertainty, and small enough to find
the faults of docs/faults.md. Figures below are those of the shipped presets: 10C is 23 A, and the
bounds of a reading's error, sensor and bus together, are 0.024 A, 2.3 mV, 0.028 K and 0.011 W.
"""

from __future__ import annotations

from typing import Any

from bms.bus_signals import BUS, RANGES
from bms.errors import InputError
from bms.presets import Preset

_SENSOR_RANGES = {
    # -50 to 100 degC, nearly 50 K beyond the operating boxes (272 to 326 K) on either side. A
    # sensor whose wire is open or shorted reads the end of its own range.
    "surface_temperature_K": (223.0, 373.0),
    "coolant_temperature_K": (223.0, 373.0),
    # All the heat of a cell at 10C is 6 to 7 W (R0 u^2), and the operating boxes end at 3 W. Less
    # than no cooling can only be the sensor's error.
    "cooling_power_W": (-1.0, 40.0),
}

# A charger gives at most what is asked for, and out of a charge a load may draw current; half as
# much again as the reference current is neither.
_CURRENT_RANGE_FACTOR = 1.5

# The open-circuit curve of an empty cell begins at 2.44 V. A cell that reads a whole volt less has
# been discharged far beyond empty and must not be charged fast, if it is the cell that is wrong.
_LOWEST_VOLTAGE_V = 1.5

# Between voltage_overshoot_V and this above its limit the cell is over-voltage, a fault of its own.
# At 10C the ohmic drop is 0.26 to 0.29 V; twice that above the limit is a wire, not a cell.
_VOLTAGE_HEADROOM_V = 0.6

_DEVIATIONS = {
    # Current against the last command, which the charger answers a period later. A growing current
    # is one step of the growth limit behind (0.23 A: 1C per second for 0.1 s); a faster fall is
    # over before the three periods that the fault takes.
    "current_deviation_A": 1.0,
    # Voltage against that of the model at counted charge and measured current. The model has no
    # polarisation, temperature or age; 0.2 V leave room for a resistance of 8.7 mohm more than R0
    # (11.4 and 12.5 mohm) at 10C. On the flat part of the curve (0.15 V from 10 to 90 % of charge)
    # a wrong state of charge stays below it.
    "voltage_deviation_V": 0.2,
    # The constraint keeps the limit itself at the true voltage; twenty times the reading's error.
    "voltage_overshoot_V": 0.05,
    # Surface above its limit; estimated core above its limit and the model's error bound. Within
    # the modelled uncertainty the worst is 0.08 K, after a minute without a safe current
    # (docs/theory.md), and the reading's error.
    "temperature_overshoot_K": 2.0,
    # Surface below the coldest that the heat allows, from which the errors of sensors, bus and
    # disturbances are subtracted already (0.20 and 0.23 K); the rest is for cells whose resistances
    # differ. A reading that is colder is not used meanwhile, so that waiting costs no safety.
    "surface_deficit_K": 1.0,
}

_FAMILY_DEVIATIONS = {
    # Beyond what a cell of the family can have, which contains resistance, polarisation and age.
    "voltage_deviation_V": 0.05,
}


def plausibility_fields(preset: Preset) -> dict[str, Any]:
    """Content of the calibration's plausibility_t as nested mapping, in the units of its names.

    Raises InputError when a reading that is not believed would not fit its CAN signal, which would
    carry the end of its range instead, a reading that is.
    """
    strongest_A = -_CURRENT_RANGE_FACTOR * preset.limits.reference_current_A
    ranges = {
        "current_A": (-strongest_A, strongest_A),
        "voltage_V": (_LOWEST_VOLTAGE_V, preset.limits.max_voltage_V + _VOLTAGE_HEADROOM_V),
        **_SENSOR_RANGES,
    }
    for key, name, carried in (
        ("limits.reference_current_A", "current_A", RANGES.current_A),
        ("limits.max_voltage_V", "voltage_V", RANGES.voltage_V),
    ):
        (low, high), (lowest, highest) = ranges[name], carried
        if not lowest <= low <= high < highest:
            value = getattr(preset.limits, key.removeprefix("limits."))
            raise InputError(
                f"preset '{preset.name}': {key}: {value:.10g} leaves no room on the CAN signal for "
                f"readings that cannot be, which begin at {high:.10g} of {highest:.10g}; lower it"
            )
    sensors, half_step = preset.sensors, BUS
    errors = {
        "reading_error": [
            sensors.current_A.error_bound + half_step.current_A,
            sensors.cooling_power_W.error_bound + half_step.cooling_power_W,
            sensors.surface_temperature_K.error_bound + half_step.surface_temperature_K,
            sensors.coolant_temperature_K.error_bound + half_step.coolant_temperature_K,
        ]
    }
    believed = {name: {"low": low, "high": high} for name, (low, high) in ranges.items()}
    deviations = _DEVIATIONS | ({} if preset.cell.interval is None else _FAMILY_DEVIATIONS)
    return believed | deviations | errors
