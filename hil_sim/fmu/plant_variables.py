"""Variables of the plant unit, with the start values that a preset gives them."""

from __future__ import annotations

from dataclasses import dataclass

from bms.presets import Preset
from hil_sim.plant.true_cell import TrueCell, nominal_cell

MOST_BRANCHES = 3
_ABSENT = 1.0
"""Start of a parameter that the preset's cell does not have; nothing depends on it."""


@dataclass(frozen=True)
class Variable:
    """A variable of real numbers; its reference is its place in the list of all."""

    name: str
    causality: str
    variability: str
    unit: str
    start: float | None
    """None for what is calculated."""
    description: str
    is_present: bool = True
    """Whether the preset's cell has it; others are not described."""


def plant_variables(preset: Preset) -> list[Variable]:
    """All variables in the order of hil_sim/fmu/native/plant_variables.h."""
    nominal = nominal_cell(preset)
    return [
        Variable("time", "independent", "continuous", "s", None, "Simulation time"),
        _input("current_A", "A", 0.0, "Current, negative while charging"),
        _input("full_cooling_power_W", "W", nominal.cooling_power_W, "Power of the cooler"),
        _output("voltage_V", "V", "Terminal voltage"),
        _output("surface_temperature_K", "K", "Temperature of the cell's surface"),
        _output("core_temperature_K", "K", "Temperature of the cell's core"),
        _output("coolant_temperature_K", "K", "Temperature of the coolant"),
        _output("soc", "1", "State of charge"),
        _output("cooling_power_W", "W", "Heat that the coolant gives away"),
        *_parameters(nominal),
    ]


def _parameters(nominal: TrueCell) -> list[Variable]:
    cell, state = nominal.cell, nominal.state
    branches = [
        variable
        for i in range(MOST_BRANCHES)
        for variable in (
            _tunable(
                f"branch{i + 1}_resistance_ohm",
                "Ohm",
                cell.branches[i].resistance_ohm if i < len(cell.branches) else _ABSENT,
                f"Resistance of branch {i + 1} of the polarisation",
                i < len(cell.branches),
            ),
            _tunable(
                f"branch{i + 1}_time_constant_s",
                "s",
                cell.branches[i].time_constant_s if i < len(cell.branches) else _ABSENT,
                f"Time constant of branch {i + 1} of the polarisation",
                i < len(cell.branches),
            ),
        )
    ]
    thermal = {
        "core_resistance_K_per_W": "Thermal resistance from core to surface",
        "core_heat_capacity_J_per_K": "Heat capacity of the core",
        "surface_resistance_K_per_W": "Thermal resistance from surface to coolant",
        "surface_heat_capacity_J_per_K": "Heat capacity of the surface",
        "coolant_heat_capacity_J_per_K": "Heat capacity of the coolant",
    }
    return [
        _fixed("initial_soc", "1", state.soc, "State of charge at the start"),
        _fixed(
            "initial_temperature_K",
            "K",
            state.core_temperature_K,
            "Temperature of core, surface and coolant at the start",
        ),
        _tunable(
            "coolant_floor_K",
            "K",
            nominal.coolant_floor_K,
            "Cooling fades out over 1 K above this temperature of the coolant",
        ),
        _tunable("capacity_Ah", "A.h", cell.capacity_Ah, "Charge from empty to full"),
        _tunable(
            "ohmic_resistance_ohm",
            "Ohm",
            cell.ohmic_resistance_ohm,
            "Ohmic resistance",
            cell.resistance is None,
        ),
        _tunable(
            "entropic_coefficient_V_per_K",
            "V/K",
            cell.entropic_coefficient_V_per_K,
            "Change of the open-circuit voltage with temperature",
            cell.entropy is None,
        ),
        _tunable("resistance_factor", "1", 1.0, "Ageing: factor on the ohmic resistance"),
        *(
            _tunable(name, "K/W" if "resistance" in name else "J/K", getattr(cell, name), said)
            for name, said in thermal.items()
        ),
        *branches,
    ]


def _input(name: str, unit: str, start: float, description: str) -> Variable:
    return Variable(name, "input", "continuous", unit, start, description)


def _output(name: str, unit: str, description: str) -> Variable:
    return Variable(name, "output", "continuous", unit, None, description)


def _fixed(name: str, unit: str, start: float, description: str) -> Variable:
    return Variable(name, "parameter", "fixed", unit, start, description)


def _tunable(
    name: str, unit: str, start: float, description: str, is_present: bool = True
) -> Variable:
    return Variable(name, "parameter", "tunable", unit, start, description, is_present)
