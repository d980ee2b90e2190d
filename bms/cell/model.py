"""Right-hand side of the cell model; every function takes floats or arrays of one shape."""

from __future__ import annotations

from typing import Any, NamedTuple

from bms.cell.parameters import CellParameters


class CellState(NamedTuple):
    """State of charge (-) and core, surface and coolant temperature (K)."""

    soc: Any
    core_temperature_K: Any
    surface_temperature_K: Any
    coolant_temperature_K: Any


class Disturbance(NamedTuple):
    """What the model does not know: additions to the four rates (1/s, K/s, K/s, K/s)."""

    soc_per_s: Any = 0.0
    core_K_per_s: Any = 0.0
    surface_K_per_s: Any = 0.0
    coolant_K_per_s: Any = 0.0


NO_DISTURBANCE = Disturbance()


def rates(
    cell: CellParameters,
    state: CellState,
    current_A: Any,
    cooling_power_W: Any,
    disturbance: Disturbance = NO_DISTURBANCE,
    polarisation_heat_W: Any = 0,
) -> CellState:
    """Time derivative of the state (1/s, K/s, K/s, K/s); the current is negative while charging.

    The heat of the branches (bms.cell.polarisation) warms the core. Source: paper, equation of the
    electro-thermal dynamics, with the coolant's own heat capacity.
    """
    soc, core, surface, coolant = state
    core_to_surface_W = (core - surface) / cell.core_resistance_K_per_W
    surface_to_coolant_W = (surface - coolant) / cell.surface_resistance_K_per_W
    # Symbols may stand for a cell of constants; they know of no table.
    entropy = getattr(cell, "entropy", None)
    entropic_V_per_K = cell.entropic_coefficient_V_per_K if entropy is None else entropy(soc)
    ohm = ohmic_resistance_ohm(cell, core, soc)
    heat_W = (ohm * current_A - entropic_V_per_K * core) * current_A + polarisation_heat_W
    return CellState(
        disturbance.soc_per_s - current_A / cell.capacity_As,
        disturbance.core_K_per_s + (heat_W - core_to_surface_W) / cell.core_heat_capacity_J_per_K,
        disturbance.surface_K_per_s
        + (core_to_surface_W - surface_to_coolant_W) / cell.surface_heat_capacity_J_per_K,
        disturbance.coolant_K_per_s
        + (surface_to_coolant_W - cooling_power_W) / cell.coolant_heat_capacity_J_per_K,
    )


def ohmic_resistance_ohm(cell: CellParameters, core_temperature_K: Any, soc: Any) -> Any:
    """Ohmic resistance in ohm at a core temperature and state of charge: table or constant."""
    table = getattr(cell, "resistance", None)
    return cell.ohmic_resistance_ohm if table is None else table(core_temperature_K, soc)


def terminal_voltage_V(
    cell: CellParameters,
    soc: Any,
    current_A: Any,
    core_temperature_K: Any = None,
    polarisation_V: tuple[Any, ...] = (),
) -> Any:
    """Terminal voltage in V: open-circuit voltage, ohmic drop, and what the branches add.

    Without a core temperature the resistance is the constant one, as a controller knows it. Source:
    paper, output equation.
    """
    if core_temperature_K is None:
        ohm = cell.ohmic_resistance_ohm
    else:
        ohm = ohmic_resistance_ohm(cell, core_temperature_K, soc)
    voltage_V = cell.ocv(soc) - current_A * ohm
    for branch_V in polarisation_V:
        voltage_V = voltage_V + branch_V
    return voltage_V
