"""Values that a preset may have by its schema, but no cell: units and signs mistaken, limits that
leave no charge."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from itertools import chain

import numpy as np

from bms.presets.agreement import ValueOf
from bms.presets.schema import Sensor

Slip = tuple[str, str, str]
"""Key, what is odd, remedy."""

_LARGEST_CAPACITY_AH = 1000.0
_LARGEST_RESISTANCE_OHM_AH = 2.0
"""Of ohmic resistance times capacity; cells have 0.01 to 0.3."""
_HEAT_CAPACITY_J_PER_K_AH = (3.0, 300.0)
"""Of core and surface together over capacity; cells have 10 to 60."""
_LONGEST_CHARGE_H, _STRONGEST_C_RATE = 100.0, 50.0


def likely_slips(value_of: ValueOf) -> Iterator[Slip]:
    """What is odd in the values of a preset whose keys are all right for themselves."""
    yield from chain(_units(value_of), _full(value_of), _start(value_of))


def _units(value_of: ValueOf) -> Iterator[Slip]:
    capacity_Ah = value_of("cell.capacity_Ah")
    if capacity_Ah > _LARGEST_CAPACITY_AH:
        yield (
            "cell.capacity_Ah", f"{capacity_Ah:g} A h is more than any cell has",
            f"write ampere hours: {capacity_Ah / 1000.0:g} if these are mA h",
        )  # fmt: skip
        return
    resistance_ohm = value_of("cell.ohmic_resistance_ohm")
    if resistance_ohm * capacity_Ah > _LARGEST_RESISTANCE_OHM_AH:
        yield (
            "cell.ohmic_resistance_ohm",
            f"{resistance_ohm:g} ohm is more than a cell of {capacity_Ah:g} A h has",
            f"write ohm: {resistance_ohm / 1000.0:g} if these are milliohm",
        )
    heat_J_per_K = value_of("cell.core_heat_capacity_J_per_K") + value_of(
        "cell.surface_heat_capacity_J_per_K"
    )
    least, most = _HEAT_CAPACITY_J_PER_K_AH
    if not least <= heat_J_per_K / capacity_Ah <= most:
        yield (
            "cell.core_heat_capacity_J_per_K",
            f"with the surface's {heat_J_per_K:g} J/K, which no cell of {capacity_Ah:g} A h has",
            "write that of the whole cell in J/K: mass in kg times specific heat in J/(kg K)",
        )
    rate = -value_of("limits.reference_current_A") / capacity_Ah
    if not 1.0 / _LONGEST_CHARGE_H <= rate <= _STRONGEST_C_RATE:
        yield (
            "limits.reference_current_A", f"is {rate:.3g} times the capacity in an hour",
            "write ampere, not milliampere nor a C-rate",
        )  # fmt: skip


def _full(value_of: ValueOf) -> Iterator[Slip]:
    """The open-circuit voltage where the charge has to end, against the voltage limit."""
    soc, voltage_V = value_of("cell.ocv.soc"), value_of("cell.ocv.voltage_V")
    full, limit_V = value_of("limits.completion_soc"), value_of("limits.max_voltage_V")
    end_V = float(np.interp(full, soc, voltage_V))
    if end_V >= limit_V:
        yield (
            "limits.max_voltage_V",
            f"{limit_V:g} V is not above the open-circuit voltage {end_V:.4g} V at "
            f"limits.completion_soc {full:g}, so that the charge is never complete",
            "raise it, if the data sheet allows it, or lower limits.completion_soc",
        )
        return
    error_V = value_of("cell.interval.ocv_error_V")
    if error_V is None:
        return
    # A family's cell is full when its least open-circuit voltage is: reading, and no more, less all
    # errors. The reading stays below the limit by its own error.
    sensor = Sensor(*(value_of(f"sensors.voltage_V.{field.name}") for field in fields(Sensor)))
    proven_V = limit_V - error_V - 2.0 * sensor.error_bound
    if end_V >= proven_V:
        yield (
            "limits.completion_soc",
            f"{full:g} is at an open-circuit voltage of {end_V:.4g} V, and no voltage within "
            f"limits.max_voltage_V proves more than {proven_V:.4g} V with the errors of "
            "cell.interval.ocv_error_V and sensors.voltage_V, so that the charge is never complete",
            f"lower it below {float(np.interp(proven_V, voltage_V, soc)):.3f}",
        )


def _start(value_of: ValueOf) -> Iterator[Slip]:
    begin_K = value_of("initial.temperature_K")
    for limit in ("max_core_temperature_K", "max_surface_temperature_K"):
        limit_K = value_of(f"limits.{limit}")
        if begin_K >= limit_K:
            yield (
                "initial.temperature_K", f"{begin_K:g} K is not below limits.{limit} {limit_K:g} K",
                "start colder, or no current is safe",
            )  # fmt: skip
    readings = {
        "surface_temperature_K": ("initial.temperature_K", begin_K),
        "coolant_temperature_K": ("initial.temperature_K", begin_K),
        "cooling_power_W": ("initial.cooling_power_W", value_of("initial.cooling_power_W")),
    }
    for name, (key, start) in readings.items():
        low, high = value_of(f"operating_box.{name}")
        if not low <= start <= high:
            yield (
                f"operating_box.{name}",
                f"{low:g} to {high:g} does not hold {key} {start:g}, so that no charge begins",
                "widen it, or start elsewhere",
            )
    if value_of("initial.soc") >= value_of("limits.completion_soc"):
        yield (
            "initial.soc", "is not below limits.completion_soc, so that nothing is charged",
            "start emptier",
        )  # fmt: skip
    for limit in ("max_core_temperature_K", "max_surface_temperature_K"):
        low_K = value_of("operating_box.surface_temperature_K")[0]
        if low_K >= value_of(f"limits.{limit}"):
            yield (
                "operating_box.surface_temperature_K",
                f"begins at {low_K:g} K, not below limits.{limit}",
                "begin it 2 K below the coldest plug-in",
            )
