"""What the firmware takes of a preset: sizes of tables, the envelope of calibrations, the bus.

The firmware refuses the rest; here it is told before anything is trained for it.
"""

from __future__ import annotations

from collections.abc import Iterator

from bms.bus_signals import RANGES
from bms.presets.agreement import ValueOf
from bms.presets.authoring.slips import Slip

LONGEST_TABLES = {
    "cell.ocv.soc": 64,
    "current_map.temperature_K": 8,
    "current_map.soc": 8,
}
"""Most points of each, as the firmware reserves them."""
ENVELOPE = {
    "cell.capacity_Ah": (0.5, 300.0, "A h"),
    "limits.max_voltage_V": (1.5, 4.5, "V"),
    "limits.max_core_temperature_K": (253.0, 353.0, "K"),
    "limits.max_surface_temperature_K": (253.0, 353.0, "K"),
    "cell.ocv.voltage_V": (0.0, 4.6, "V"),
}
"""Of a single cell; ENVELOPE of calibration.c says the same."""
_BEYOND_REFERENCE = 1.5
_BEYOND_BOX = 1.05
"""Up to which readings are believed; the bus carries more, so that it can tell what cannot be."""


def firmware_limits(value_of: ValueOf) -> Iterator[Slip]:
    """What the firmware would not take: key, what is too much or too little, remedy."""
    for key, most in LONGEST_TABLES.items():
        points = value_of(key)
        if points is not None and len(points) > most:
            yield (
                key, f"has {len(points)} points, and the firmware's table at most {most}",
                "leave out those that a straight line between their neighbours replaces",
            )  # fmt: skip
    for key, (low, high, unit) in ENVELOPE.items():
        value = value_of(key)
        values = value if isinstance(value, list) else [value]
        if value is not None and not all(low <= number <= high for number in values):
            yield (
                key, f"the firmware takes {low:g} to {high:g} {unit}",
                "this firmware is for one lithium-ion cell; check number and unit",
            )  # fmt: skip
    for key, size, share, end in (
        (
            "limits.reference_current_A", -value_of("limits.reference_current_A"),
            _BEYOND_REFERENCE, RANGES.current_A[1],
        ),
        (
            "operating_box.cooling_power_W", value_of("operating_box.cooling_power_W")[1],
            _BEYOND_BOX, RANGES.cooling_power_W[1],
        ),
    ):  # fmt: skip
        if share * size >= end:
            yield (
                key, f"{size:g} leaves no room on the CAN signal, which ends at {end:g}",
                f"make it less than {end / share:.4g} in size",
            )  # fmt: skip
