"""The plant of `fmu:FILE`: a cell that anybody has made a unit of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from bms.cell import CellState
from bms.errors import InputError
from bms.presets import Preset
from hil_sim.fmu.unit import Unit
from hil_sim.plant.disturbances import Source
from hil_sim.plant.plant import SUB_STEPS, Extremes

CURRENT = "current_A"
VOLTAGE = "voltage_V"
STATE = ("soc", "core_temperature_K", "surface_temperature_K", "coolant_temperature_K")
"""In the order of CellState."""
COOLING = "cooling_power_W"
FULL_COOLING = "full_cooling_power_W"
INITIAL_SOC = "initial_soc"
INITIAL_TEMPERATURE = "initial_temperature_K"

_REAL_TYPES = ("Real", "Float64")
_READABLE = ("output", "local")


@dataclass(frozen=True)
class _Need:
    unit: str
    is_input: bool
    is_required: bool = True


_NEEDS = {
    CURRENT: _Need("A", is_input=True),
    VOLTAGE: _Need("V", is_input=False),
    **{name: _Need("1" if name == "soc" else "K", is_input=False) for name in STATE},
    COOLING: _Need("W", is_input=False, is_required=False),
    FULL_COOLING: _Need("W", is_input=True, is_required=False),
}


def make(argument: str, preset: Preset, disturbance: Source) -> ForeignPlant:
    """The plant of `fmu:FILE[,OURS=THEIRS]...`, where THEIRS is the unit's name of a variable.

    Raises InputError for a unit that cannot be the plant, with all that it lacks, and for a
    disturbance.
    """
    file, *renamings = argument.split(",")
    where = f"--plant fmu:{argument}"
    if not file:
        raise InputError(f"{where}: give the path of a unit for co-simulation (.fmu)")
    names = {name: name for name in _NEEDS}
    for text in renamings:
        ours, _, theirs = text.partition("=")
        if ours not in names or not theirs:
            raise InputError(
                f"{where}: '{text}' names no variable; write {CURRENT}=NAME, with one of "
                f"{', '.join(names)} in front"
            )
        names[ours] = theirs
    unit = Unit(Path(file), f"--plant fmu:{file}")
    references = _references(unit, names, f"--plant fmu:{file}")
    if any(next(disturbance)):
        raise InputError(
            f"{where}: a unit takes no disturbance of its rates; leave --disturbance out, or take "
            "a plant of this project"
        )
    return ForeignPlant(unit, references, preset, disturbance, f"--plant fmu:{file}")


def _references(unit: Unit, names: Mapping[str, str], where: str) -> dict[str, int]:
    """Our name -> the unit's reference; InputError with everything that is missing or wrong."""
    wrong, found = [], {}
    for ours, need in _NEEDS.items():
        variable = unit.variables.get(names[ours])
        kind = f"{'input' if need.is_input else 'output'} {names[ours]} ({need.unit})"
        if variable is None:
            if need.is_required or names[ours] != ours:
                wrong.append(f"no {kind}")
            continue
        said = variable.unit or (variable.declaredType.unit if variable.declaredType else None)
        if variable.type not in _REAL_TYPES:
            wrong.append(f"{names[ours]} is of type {variable.type}, not a real number")
        elif variable.dimensions:
            wrong.append(f"{names[ours]} is an array, not one number")
        elif variable.causality not in (("input",) if need.is_input else _READABLE):
            wrong.append(f"no {kind}: it is of causality {variable.causality}")
        elif (said or "1") != need.unit:
            wrong.append(f"{names[ours]} in {said or 'no unit'}, not in {need.unit}")
        else:
            found[ours] = variable.valueReference
    if wrong:
        raise InputError(
            f"{where}: {'; '.join(wrong)}; a plant needs these, the current negative while "
            f"charging; name what is called otherwise by ,{CURRENT}=NAME and so on"
        )
    return found


class ForeignPlant:
    """A cell in a unit, advanced by one control period at a time. Extremes are those at their ends.

    Where the unit has the parameters initial_soc and initial_temperature_K, it starts as the preset
    says, else as it does by itself. Without the output cooling_power_W its cooling counts as the
    preset's.
    """

    def __init__(
        self,
        unit: Unit,
        references: Mapping[str, int],
        preset: Preset,
        disturbance: Source,
        where: str,
    ) -> None:
        self._unit, self._references, self._where = unit, references, where
        self._source = disturbance
        self._period_s = preset.timing.sampling_period_s
        self._full_cooling_W = preset.initial.cooling_power_W
        self._current_A = 0.0
        unit.instantiate()
        self._start(preset)
        self.state = self._state_now()
        """True state, as it was when the last period ended."""
        state = self.state
        self.extremes = Extremes(
            state.core_temperature_K, state.surface_temperature_K, self.voltage_V, state.soc
        )

    @property
    def current_A(self) -> float:
        """Current in A, held until it is set anew."""
        return self._current_A

    @current_A.setter
    def current_A(self, current_A: float) -> None:
        self._unit.set([self._references[CURRENT]], [current_A])
        self._current_A = current_A

    @property
    def cooling_power_W(self) -> float:
        """Heat in W that the coolant gives away; what is set is the cooler's full power."""
        if COOLING in self._references:
            return self._unit.get([self._references[COOLING]])[0]
        return self._full_cooling_W

    @cooling_power_W.setter
    def cooling_power_W(self, full_W: float) -> None:
        if FULL_COOLING not in self._references:
            raise InputError(
                f"{self._where}: has no input {FULL_COOLING} (W), so that its cooling cannot "
                "fail; leave that fault out"
            )
        self._unit.set([self._references[FULL_COOLING]], [full_W])
        self._full_cooling_W = full_W

    @property
    def voltage_V(self) -> float:
        """Terminal voltage in V, as the unit has it at present."""
        return self._unit.get([self._references[VOLTAGE]])[0]

    def advance(self) -> None:
        """Hold the present current for one control period."""
        for _ in islice(self._source, SUB_STEPS):
            pass
        self._unit.step(self._period_s)
        state, peaks = self._state_now(), self.extremes
        self.state = state
        peaks.core_temperature_K = max(peaks.core_temperature_K, state.core_temperature_K)
        peaks.surface_temperature_K = max(peaks.surface_temperature_K, state.surface_temperature_K)
        peaks.soc = max(peaks.soc, state.soc)
        peaks.voltage_V = max(peaks.voltage_V, self.voltage_V)

    def _start(self, preset: Preset) -> None:
        unit, start = self._unit, preset.initial
        wanted = {INITIAL_SOC: start.soc, INITIAL_TEMPERATURE: start.temperature_K}
        present = {
            unit.variables[name].valueReference: value
            for name, value in wanted.items()
            if name in unit.variables and unit.variables[name].causality == "parameter"
        }
        unit.enter_initialization()
        unit.set(list(present), list(present.values()))
        if FULL_COOLING in self._references:
            unit.set([self._references[FULL_COOLING]], [start.cooling_power_W])
        unit.initialize()

    def _state_now(self) -> CellState:
        return CellState(*self._unit.get([self._references[name] for name in STATE]))
