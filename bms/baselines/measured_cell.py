"""What a charger without a thermal model can tell from its measurements: the voltage to come."""

from __future__ import annotations

import math

from bms.decision import Observation
from bms.presets import Preset


def usable(observation: Observation) -> bool:
    """Whether everything that a measuring charger needs is there and finite."""
    return all(
        map(
            math.isfinite,
            (
                observation.soc,
                observation.surface_temperature_K,
                observation.reference_current_A,
                observation.voltage_V,
                observation.current_A,
            ),
        )
    )


def charging_voltage_V(preset: Preset) -> float:
    """Voltage that a charger aims at in V: the limit less the error bound of the sensor."""
    return preset.limits.max_voltage_V - preset.sensors.voltage_V.error_bound


def voltage_at_V(preset: Preset, observation: Observation, current_A: float) -> float:
    """Terminal voltage in V at another current, by the cell's ohmic resistance."""
    change_A = observation.current_A - current_A
    return observation.voltage_V + change_A * preset.cell.ohmic_resistance_ohm


def current_at_A(preset: Preset, observation: Observation, voltage_V: float) -> float:
    """Current in A at which the terminal voltage is voltage_V; positive means discharge."""
    change_V = observation.voltage_V - voltage_V
    return observation.current_A + change_V / preset.cell.ohmic_resistance_ohm
