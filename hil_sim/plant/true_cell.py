"""The cell that is plugged in, as it truly is, whatever the preset and the charger say of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from bms.cell import CellParameters, CellState, Polarisation, at_rest_V
from bms.presets import Preset
from bms.presets.schema import Initial, Sensors
from hil_sim.plant.sensors import Readings

COOLING_BAND_K = 1.0
"""A cooler's thermostat is proportional, from full power down to none."""


@dataclass(frozen=True)
class TrueCell:
    """A cell with its branches' voltages, its cooling, its charger and its sensors at plug-in.

    The charger tells the ECU `plug_in_soc`, whatever the state says; its current is that of a
    command times 1 + `supply_tolerance`, after `supply_lag_s`. `biases` take the place of those of
    the preset's sensors.
    """

    cell: CellParameters
    state: CellState
    cooling_power_W: float
    plug_in_soc: float
    polarisation_V: Polarisation
    biases: Readings
    supply_tolerance: float = 0.0
    supply_lag_s: float = 0.0
    coolant_floor_K: float = 0.0
    """The cooling fades out over COOLING_BAND_K above this temperature of the coolant."""

    def sensors(self, sensors: Sensors) -> Sensors:
        """The preset's sensors with the biases of this cell's."""
        return replace(
            sensors,
            **{
                name: replace(getattr(sensors, name), bias=bias)
                for name, bias in self.biases._asdict().items()
            },
        )


def nominal_cell(preset: Preset, start: Initial | None = None) -> TrueCell:
    """The preset's own cell at rest at one temperature, with an ideal charger that tells the truth.

    It starts as the preset says unless another start is given.
    """
    start = start or preset.initial
    return TrueCell(
        cell=preset.cell,
        state=CellState(start.soc, *[start.temperature_K] * 3),
        cooling_power_W=start.cooling_power_W,
        plug_in_soc=start.soc,
        polarisation_V=at_rest_V(preset.cell),
        biases=Readings(*(getattr(preset.sensors, name).bias for name in Readings._fields)),
    )


def cooling_share(coolant_temperature_K: float, floor_K: float) -> float:
    """Share of its power that a cooler gives at a coolant temperature in K, 0..1."""
    return min(max((coolant_temperature_K - floor_K) / COOLING_BAND_K, 0.0), 1.0)
