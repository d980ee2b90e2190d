"""What readings the firmware believes, and how far they may be from what it expects of them.

Those of current, voltage and cooling follow the preset's own cell. Each is many times what sensors,
bus and model can err by, so that none is crossed in a charge within the modelled uncertainty, and
small enough to find the faults of docs/faults.md. Figures below are those of the A123 presets: 10C
is 23 A, and the bounds of a reading's error, sensor and bus together, are 0.024 A, 2.3 mV, 0.028 K
and 0.011 W.
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
}
# All the heat of a 26650 at 10C is 6 to 7 W (R0 u^2), and its operating boxes end at 3 W. Less than
# no cooling can only be the sensor's error. A large cell's box reaches further, with some room.
_COOLING_W = (-1.0, 40.0)
_BOX_ROOM = 1.05

# A charger gives at most what is asked for, and out of a charge a load may draw current; half as
# much again as the reference current is neither.
_CURRENT_RANGE_FACTOR = 1.5

# The open-circuit curve of an empty cell begins at 2.44 V. A cell that reads a whole volt less has
# been discharged far beyond empty and must not be charged fast, if it is the cell that is wrong.
# A titanate cell is empty at 1.5 to 2 V already; half a volt below that is as far beyond.
_LOWEST_VOLTAGE_V = 1.5
_BELOW_EMPTY_V = 0.5

# Between voltage_overshoot_V and this above its limit the cell is over-voltage, a fault of its own.
# At 10C the ohmic drop is 0.26 to 0.29 V; twice that above the limit is a wire, not a cell.
_VOLTAGE_HEADROOM_V = 0.6

# Current against the last command, which the charger answers a period later: this share of the
# strongest current is 1 A of 23 A. It is at least twice the step by which a growing current is
# behind (0.5 A: 5 A/s for 0.1 s), and twenty times the reading's error; a faster fall is over
# before the three periods that the fault takes. A ramp so steep that a quarter of the strongest
# current would pass for it is refused. The firmware takes no more than 300 A.
_CURRENT_SHARE = 1.0 / 23.0
_GROWTH_STEPS = 2.0
_GROWTH_SHARE = 0.25
_CURRENT_ERRORS = 20.0
_LARGEST_DEVIATION_A = 300.0

# Voltage against that of the model at counted charge and measured current. The model has no
# polarisation, temperature or age; 0.2 V leave room for a resistance of 8.7 mohm more than R0
# (11.4 and 12.5 mohm) at 10C, two thirds of the ohmic drop. On the flat part of the curve (0.15 V
# from 10 to 90 % of charge) a wrong state of charge stays below it. The firmware takes no more
# than 1 V.
_VOLTAGE_DEVIATION_V = 0.2
_DROP_SHARE = 2.0 / 3.0
_LARGEST_DEVIATION_V = 1.0

_OVERSHOOTS = {
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

# Beyond what a cell of the family can have, which contains resistance, polarisation and age.
_FAMILY_VOLTAGE_DEVIATION_V = 0.05


def plausibility_fields(preset: Preset) -> dict[str, Any]:
    """Content of the calibration's plausibility_t as nested mapping, in the units of its names.

    Raises InputError when a reading that is not believed would not fit its CAN signal, which would
    carry the end of its range instead, a reading that is, and when the current may grow so fast
    that what the charger does cannot be told from what it was told.
    """
    strongest_A = -_CURRENT_RANGE_FACTOR * preset.limits.reference_current_A
    ranges = {
        "current_A": (-strongest_A, strongest_A),
        "voltage_V": (
            max(min(_LOWEST_VOLTAGE_V, preset.cell.ocv.voltage_V[0] - _BELOW_EMPTY_V), 0.0),
            preset.limits.max_voltage_V + _VOLTAGE_HEADROOM_V,
        ),
        "cooling_power_W": _cooling_range_W(preset),
        **_SENSOR_RANGES,
    }
    limits, box = preset.limits, preset.operating_box
    for key, value, name, carried in (
        (
            "limits.reference_current_A", limits.reference_current_A, "current_A", RANGES.current_A,
        ),
        ("limits.max_voltage_V", limits.max_voltage_V, "voltage_V", RANGES.voltage_V),
        (
            "operating_box.cooling_power_W", box.cooling_power_W[1], "cooling_power_W",
            RANGES.cooling_power_W,
        ),
    ):  # fmt: skip
        (low, high), (lowest, highest) = ranges[name], carried
        if not lowest <= low <= high < highest:
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
    deviations = {
        "current_deviation_A": _current_deviation_A(preset, errors["reading_error"][0]),
        "voltage_deviation_V": _voltage_deviation_V(preset),
    }
    return believed | deviations | _OVERSHOOTS | errors


def _cooling_range_W(preset: Preset) -> tuple[float, float]:
    low_W, high_W = preset.operating_box.cooling_power_W
    return min(_COOLING_W[0], _BOX_ROOM * low_W), max(_COOLING_W[1], _BOX_ROOM * high_W)


def _current_deviation_A(preset: Preset, error_A: float) -> float:
    limits = preset.limits
    strongest_A = -limits.reference_current_A
    period_s = preset.timing.sampling_period_s
    growth_A = _GROWTH_STEPS * limits.current_growth_A_per_s * period_s
    most_A = _GROWTH_SHARE * strongest_A
    if growth_A > most_A:
        raise InputError(
            f"preset '{preset.name}': limits.current_growth_A_per_s: "
            f"{limits.current_growth_A_per_s:.10g} grows so fast that a wrong current would pass "
            f"for it; at most {most_A / (_GROWTH_STEPS * period_s):.10g}, an eighth of "
            "limits.reference_current_A in each timing.sampling_period_s"
        )
    wanted_A = max(_CURRENT_SHARE * strongest_A, growth_A, _CURRENT_ERRORS * error_A)
    return min(wanted_A, _LARGEST_DEVIATION_A)


def _voltage_deviation_V(preset: Preset) -> float:
    if preset.cell.interval is not None:
        return _FAMILY_VOLTAGE_DEVIATION_V
    drop_V = -preset.limits.reference_current_A * preset.cell.ohmic_resistance_ohm
    return min(max(_VOLTAGE_DEVIATION_V, _DROP_SHARE * drop_V), _LARGEST_DEVIATION_V)
