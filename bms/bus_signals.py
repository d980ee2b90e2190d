"""What signals of the CAN database carry, as far as presets, margins and bounds depend on it.

codegen has the database and comes later; tests hold these numbers to it.
"""

from __future__ import annotations

from dataclasses import dataclass

Interval = tuple[float, float]


@dataclass(frozen=True)
class BusQuantisation:
    """Half a step of each signal that is measured or given at plug-in.

    Commands are rounded towards zero, but for values that float32 puts just below a step:
    `command_A` is the most by which a command exceeds what was decided.
    """

    current_A: float = 0.001
    voltage_V: float = 0.00005
    surface_temperature_K: float = 0.0025
    coolant_temperature_K: float = 0.0025
    cooling_power_W: float = 0.0005
    plug_in_soc: float = 1e-5
    command_A: float = 7e-5


@dataclass(frozen=True)
class BusRanges:
    """Lowest and highest value of each quantity; what is beyond would be sent as the end."""

    current_A: Interval = (-1048.576, 1048.57)
    voltage_V: Interval = (0.0, 6.5533)
    temperature_K: Interval = (200.0, 527.665)
    cooling_power_W: Interval = (-20.0, 45.533)


BUS = BusQuantisation()
RANGES = BusRanges()
