"""S-CBF: barriers on voltage, state of charge and surface temperature only, in a cascade.

Method of Feng et al. 2024 as the paper describes it (section "Simulation results"): true states,
no margins for uncertainty, no reversible heat in the design. The thermal stage chooses the heat
q = R0 u^2 nearest to the wanted one under the surface barrier, which is linear in q; the electrical
stage chooses the current nearest to the reference under |u| <= sqrt(q / R0), voltage and state of
charge. Each stage is a quadratic program in one variable over an interval, whose optimum is the
projection onto the interval, so neither needs a solver.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from bms.barrier import BarrierConstants, barrier_constants
from bms.cell import CellParameters, CellState
from bms.decision import INVALID, ConstraintMargins, Decision, Observation
from bms.presets import Preset


class Cascade(NamedTuple):
    """Both stages' results: the heat that the surface allows and each constraint's lowest current.

    A heat below zero means that the surface barrier allows no heat at all.
    """

    heat_W: Any
    voltage_A: Any
    soc_A: Any
    surface_A: Any


def surface_barrier(
    preset: Preset,
    constants: BarrierConstants,
    state: CellState,
    cooling_power_W: Any,
    resistive_K_per_s2: Any = 0.0,
) -> Any:
    """Second-order surface barrier without reversible heat in K/s^2; must not be negative.

    resistive_K_per_s2 is what the Joule heat takes from it, A9 u^2. Floats or arrays of one shape.
    """
    _, core_K, surface_K, coolant_K = state
    return (
        constants.a4_per_s2 * (core_K - surface_K)
        + constants.a6_per_s2 * (coolant_K - surface_K)
        + preset.gains.alpha3_per_s2 * (preset.limits.max_surface_temperature_K - surface_K)
        + constants.a10_K_per_Ws2 * cooling_power_W
        + resistive_K_per_s2
    )


def cascade(
    cell: CellParameters,
    preset: Preset,
    constants: BarrierConstants,
    state: CellState,
    cooling_power_W: Any,
    reference_current_A: Any,
) -> Cascade:
    """Thermal and electrical stage for many cells or states at once; floats or arrays."""
    limits, resistance_ohm = preset.limits, cell.ohmic_resistance_ohm
    slope_K_per_Ws2 = -constants.a9_K_per_A2s2 / resistance_ohm
    room_K_per_s2 = surface_barrier(preset, constants, state, cooling_power_W)
    heat_W = np.minimum(room_K_per_s2 / slope_K_per_Ws2, resistance_ohm * reference_current_A**2)
    return Cascade(
        heat_W=heat_W,
        voltage_A=-(limits.max_voltage_V - cell.ocv(state.soc)) / resistance_ohm,
        soc_A=-cell.capacity_As * preset.gains.alpha1_per_s * (limits.max_soc - state.soc),
        surface_A=-np.sqrt(np.maximum(heat_W, 0.0) / resistance_ohm),
    )


def charging_current_A(stages: Cascade, reference_current_A: Any) -> Any:
    """Current of the cascade in A; 0 A where nothing is allowed."""
    lower_A = np.maximum(
        np.maximum(stages.voltage_A, stages.soc_A),
        np.maximum(stages.surface_A, reference_current_A),
    )
    return np.where((stages.heat_W >= 0.0) & (lower_A <= 0.0), lower_A, 0.0)


class SurfaceBarrierController:
    """The baseline as a controller of one cell."""

    name = "s-cbf"

    def __init__(self, preset: Preset) -> None:
        """Controller for a preset's cell, limits and gains."""
        self._preset = preset
        self._constants = barrier_constants(preset.cell, preset)

    def decide(self, observation: Observation) -> Decision:
        """Charging current for the next period; 0 A and "invalid" for input that is not finite.

        The method has no core constraint: that margin is always infinite.
        """
        state = CellState(*observation[:4])
        told = (*state, observation.cooling_power_W, observation.reference_current_A)
        if not all(map(math.isfinite, told)):
            return INVALID
        strongest_A = self._preset.limits.reference_current_A
        wanted_A = min(max(observation.reference_current_A, strongest_A), 0.0)
        stages = cascade(
            self._preset.cell,
            self._preset,
            self._constants,
            state,
            observation.cooling_power_W,
            wanted_A,
        )
        bounds_A = {
            "none": wanted_A,
            "voltage": float(stages.voltage_A),
            "soc": float(stages.soc_A),
            "surface": float(stages.surface_A) if stages.heat_W >= 0.0 else math.inf,
        }
        active = max(bounds_A, key=bounds_A.__getitem__)
        lower_A = bounds_A[active]
        feasible = lower_A <= 0.0
        current_A = lower_A if feasible else 0.0
        return Decision(
            current_A=current_A,
            feasible=feasible,
            active_constraint=active if feasible else "infeasible",
            lower_A=lower_A,
            upper_A=0.0,
            margins=self._margins(state, observation.cooling_power_W, current_A),
        )

    def _margins(
        self, state: CellState, cooling_power_W: float, current_A: float
    ) -> ConstraintMargins:
        cell, limits = self._preset.cell, self._preset.limits
        resistive_K_per_s2 = self._constants.a9_K_per_A2s2 * current_A**2
        soc_room = self._preset.gains.alpha1_per_s * (limits.max_soc - state.soc)
        return ConstraintMargins(
            voltage_V=float(
                limits.max_voltage_V - cell.ocv(state.soc) + cell.ohmic_resistance_ohm * current_A
            ),
            soc_per_s=current_A / cell.capacity_As + soc_room,
            core_K_per_s=math.inf,
            surface_K_per_s2=float(
                surface_barrier(
                    self._preset, self._constants, state, cooling_power_W, resistive_K_per_s2
                )
            ),
        )
