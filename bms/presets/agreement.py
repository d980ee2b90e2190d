"""What keys of a preset have to be among each other, and to fit the CAN bus."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from bms.bus_signals import RANGES, Interval

ValueOf = Callable[[str], Any]
"""Value of a key by its dotted path; None where there is none that can be used."""

ON_THE_BUS: dict[str, Interval] = {
    "limits.reference_current_A": RANGES.current_A,
    "limits.max_voltage_V": RANGES.voltage_V,
    "limits.max_core_temperature_K": RANGES.temperature_K,
    "limits.max_surface_temperature_K": RANGES.temperature_K,
    "initial.temperature_K": RANGES.temperature_K,
    "initial.cooling_power_W": RANGES.cooling_power_W,
    "cell.ocv.voltage_V": RANGES.voltage_V,
    "operating_box.current_A": RANGES.current_A,
    "operating_box.cooling_power_W": RANGES.cooling_power_W,
    "operating_box.surface_temperature_K": RANGES.temperature_K,
    "operating_box.coolant_temperature_K": RANGES.temperature_K,
}
"""Ranges of everything that the CAN bus has to carry, by key."""


def disagreements(value_of: ValueOf) -> Iterator[str]:
    """All complaints, each beginning with the key; keys without a value are passed over."""
    for key, (lowest, highest) in ON_THE_BUS.items():
        value = value_of(key)
        values = () if value is None else value if isinstance(value, (tuple, list)) else (value,)
        for number in values:
            if not lowest <= number <= highest:
                yield (
                    f"{key}: {number:.10g} does not fit the CAN signal, which carries "
                    f"{lowest:.10g} to {highest:.10g}"
                )
    box_A, reference_A = value_of("operating_box.current_A"), value_of("limits.reference_current_A")
    if box_A is not None and reference_A is not None and not box_A[0] < reference_A < 0 < box_A[1]:
        yield "operating_box.current_A: must hold both limits.reference_current_A and 0"
    full, most = value_of("limits.completion_soc"), value_of("limits.max_soc")
    if full is not None and most is not None and full > most:
        yield "limits.completion_soc: must not exceed limits.max_soc"
