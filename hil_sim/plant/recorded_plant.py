"""A cell whose resistance over state of charge comes from a recording instead of the preset."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bms.cell import CellState, ResistanceTable
from bms.data.charge import counted_soc
from bms.data.measurements import read_columns
from bms.errors import InputError
from bms.presets import Preset
from hil_sim.plant.arguments import Range, split_argument
from hil_sim.plant.disturbances import Source
from hil_sim.plant.heated_masses import HeatedMasses
from hil_sim.plant.plant import Extremes

COLUMNS = ("time_s", "current_A", "voltage_V")
CLASSES = 20
"""Equal parts of the state of charge, each with one resistance."""
LEAST_CURRENT_SHARE = 0.1
"""Of the largest current: below, the error of the open-circuit voltage would decide."""
LEAST_SAMPLES = 5

_OPTIONS = {"soc": Range(0.0, 1.0, "")}


def make(argument: str, preset: Preset, disturbance: Source) -> RecordedPlant:
    """The plant of `recorded:CSV[,soc=START]`; InputError for a recording that cannot be used."""
    path, options = split_argument("recorded", argument, _OPTIONS)
    if not path:
        raise InputError(
            f"--plant recorded:{argument}: give a CSV file with the columns {', '.join(COLUMNS)}"
        )
    table = recorded_resistance(Path(path), preset, options.get("soc"))
    return RecordedPlant(preset, disturbance, table)


def recorded_resistance(
    path: Path, preset: Preset, start_soc: float | None = None
) -> ResistanceTable:
    """Resistance (ohm) over state of charge that gives a recording's irreversible heat.

    The charge counts from `start_soc`, else from where the preset's open-circuit voltage is the
    first voltage of the recording, by the preset's capacity. In each class of the state of charge
    the resistance is the overpotential's work over the squared current, sum u (OCV - V) dt over
    sum u^2 dt. Raises InputError for a file that cannot be read or does not begin at rest, and
    where a class has no positive resistance.
    """
    time_s, current_A, voltage_V = read_columns(path, COLUMNS)
    is_flowing = np.abs(current_A) >= LEAST_CURRENT_SHARE * np.max(np.abs(current_A))
    if not np.any(np.abs(current_A) > 0.0):
        raise InputError(f"{path}: no current flows; give a recording of a charge or a drive")
    cell = preset.cell
    if start_soc is None:
        if is_flowing[0]:
            raise InputError(
                f"{path}: begins with {current_A[0]:g} A, so that its first voltage does not tell "
                "the state of charge; add ',soc=' and the state of charge at its start"
            )
        start_soc = float(cell.ocv.soc_at(voltage_V[0]))
    steps_s = np.diff(time_s, append=time_s[-1])
    soc = counted_soc(cell, start_soc, time_s, current_A)
    work_J = current_A * (cell.ocv(soc) - voltage_V) * steps_s
    square_A2s = current_A**2 * steps_s
    # What is counted beyond full or empty tells of the capacity, not of the resistance.
    usable = is_flowing & (soc >= 0.0) & (soc <= 1.0)
    place = np.minimum((soc * CLASSES).astype(int), CLASSES - 1)
    middles, ohms = [], []
    for number in range(CLASSES):
        here = usable & (place == number)
        if np.count_nonzero(here) < LEAST_SAMPLES:
            continue
        ohm = float(np.sum(work_J[here]) / np.sum(square_A2s[here]))
        middle = (number + 0.5) / CLASSES
        if not ohm > 0.0:
            raise InputError(
                f"{path}: {1e3 * ohm:.3g} mohm at state of charge {middle:g} with the "
                f"open-circuit voltage of '{preset.name}'; give the start with ',soc=', or a "
                "preset of the recorded cell"
            )
        middles.append(middle)
        ohms.append(ohm)
    if not middles:
        raise InputError(
            f"{path}: fewer than {LEAST_SAMPLES} rows with current in every part of the state of "
            "charge; give a longer recording"
        )
    return ResistanceTable((preset.initial.temperature_K,), tuple(middles), (tuple(ohms),))


class RecordedPlant:
    """The two masses of the preset with its open-circuit voltage and a recording's resistance."""

    def __init__(self, preset: Preset, disturbance: Source, resistance: ResistanceTable) -> None:
        self._parameters, self._resistance = preset.cell, resistance
        self._period_s = preset.timing.sampling_period_s
        self._masses = HeatedMasses(preset, disturbance)
        self.cooling_power_W = preset.initial.cooling_power_W
        self.current_A = 0.0
        state = self.state
        self.extremes = Extremes(
            state.core_temperature_K, state.surface_temperature_K, self.voltage_V, state.soc
        )

    @property
    def state(self) -> CellState:
        """True state of charge (-) and core, surface and coolant temperature (K)."""
        return self._masses.state

    @property
    def voltage_V(self) -> float:
        """Terminal voltage in V at the present state, with the present current."""
        cell, state = self._parameters, self.state
        return float(cell.ocv(state.soc)) - self.current_A * self._ohm()

    def advance(self) -> None:
        """Hold the present current for one control period."""
        cell, state, current_A, peaks = (
            self._parameters, self.state, self.current_A, self.extremes,
        )  # fmt: skip
        before_V = self.voltage_V
        entropic_V_per_K = (
            cell.entropic_coefficient_V_per_K
            if cell.entropy is None
            else float(cell.entropy(state.soc))
        )
        heat_W = current_A * (current_A * self._ohm() - entropic_V_per_K * state.core_temperature_K)
        soc = state.soc - current_A * self._period_s / cell.capacity_As
        self._masses.advance(heat_W, soc, self.cooling_power_W, peaks)
        peaks.soc = max(peaks.soc, soc)
        peaks.voltage_V = max(peaks.voltage_V, before_V, self.voltage_V)

    def _ohm(self) -> float:
        state = self.state
        return float(self._resistance(state.core_temperature_K, state.soc))
