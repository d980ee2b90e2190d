"""States of the safe set that have no safe current, and what 0 A makes of them.

At 0 A the temperatures obey a linear system whose matrix has no negative entry off its diagonal, so
more heat at any time never makes any temperature lower later. Heating disturbances at their bounds
are therefore the worst, and no current that heats the core can do better than 0 A. What the limits
are exceeded by at most is a linear program over the states of the domain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import linprog

from bms.arrays import Array
from bms.cell import CellParameters, CellState
from bms.verification.barriers import Barrier
from bms.verification.conditions import Condition
from bms.verification.domain import Domain
from bms.verification.search import simulate_hold

HORIZONS_S = (1.0, 10.0, 60.0)


@dataclass(frozen=True)
class Overshoot:
    """Most by which 0 A lets each limit be exceeded, a time after any state of the domain (K)."""

    time_s: float
    core_K: float
    surface_K: float


@dataclass(frozen=True)
class Fallback:
    """The infeasible part of the safe set.

    core_band_K, surface_band_K: below the limits, at uniform temperature and without cooling, no
    current is safe. best_current_A is the one that heats the core least and best_gain_K_per_s how
    much slower than at 0 A the core's temperature rises with it. uniform_excess_K is what a hold at
    0 A adds to a core that is at its limit, as are surface and coolant: a safe state that no
    current keeps safe, shown by simulation.
    """

    core_band_K: float
    surface_band_K: float
    best_current_A: float
    best_gain_K_per_s: float
    uniform_excess_K: float
    overshoots: tuple[Overshoot, ...]


def infeasible_part(domain: Domain, decided: tuple[Condition, Condition]) -> Fallback:
    """Characterise the states without a safe current, for the conditions that are decided by."""
    cell, preset = domain.cell, domain.preset
    core, surface = decided
    limit_K = preset.limits.max_core_temperature_K
    uniform = CellState(0.5, limit_K, limit_K, limit_K)
    voltage_V = cell.entropic_coefficient_V_per_K * limit_K
    best_A = float(min(0.5 * voltage_V / cell.ohmic_resistance_ohm, 0.0))
    best_A = max(best_A, preset.limits.reference_current_A)
    heat_W = (cell.ohmic_resistance_ohm * best_A - voltage_V) * best_A
    return Fallback(
        core_band_K=_band(core, best_A, limit_K),
        surface_band_K=_band(surface, best_A, limit_K),
        best_current_A=best_A,
        best_gain_K_per_s=-heat_W / cell.core_heat_capacity_J_per_K,
        uniform_excess_K=float(-simulate_hold(domain, uniform, 0.0, 0.0, Barrier.CORE)),
        overshoots=tuple(_overshoot(domain, time_s) for time_s in (domain.held_s, *HORIZONS_S)),
    )


def thermal_response(cell: CellParameters, time_s: float) -> tuple[Array, Array]:
    """Matrices that take core, surface and coolant temperature, and constant rates added to
    theirs, to the temperatures after time_s at 0 A; both 3 by 3."""
    core_W, coolant_W = 1.0 / cell.core_resistance_K_per_W, 1.0 / cell.surface_resistance_K_per_W
    flows = np.array(
        [
            [-core_W, core_W, 0.0],
            [core_W, -core_W - coolant_W, coolant_W],
            [0.0, coolant_W, -coolant_W],
        ]
    )
    capacities = np.array(
        [
            cell.core_heat_capacity_J_per_K,
            cell.surface_heat_capacity_J_per_K,
            cell.coolant_heat_capacity_J_per_K,
        ]
    )
    matrix = flows / capacities[:, None]
    whole = np.zeros((6, 6))
    whole[:3, :3], whole[:3, 3:] = matrix, np.eye(3)
    response = expm(whole * time_s)
    return response[:3, :3], response[:3, 3:]


def _band(condition: Condition, current_A: float, core_K: float) -> float:
    """Room that a condition needs at uniform temperature, without cooling, at its best current."""
    error = min(constant + per_A * current_A for constant, per_A in condition.branches())
    rest = condition.coupling * core_K * current_A + condition.squared * current_A**2
    return (condition.reserve - rest - error) / condition.room


def _overshoot(domain: Domain, time_s: float) -> Overshoot:
    """Linear program over core, surface and coolant temperature, relative to the limits."""
    limits, bounds, box = (
        domain.preset.limits, domain.preset.uncertainty, domain.preset.operating_box,
    )  # fmt: skip
    state_gain, rate_gain = thermal_response(domain.cell, time_s)
    reference_K = limits.max_surface_temperature_K
    rows, rooms = [], []
    rate = [
        domain.surface_rate(1.0, 0.0),
        domain.surface_rate(-1.0, 1.0),
        domain.surface_rate(0.0, -1.0),
    ]
    rows.append([rate[0], rate[1] + domain.chain.first_per_s, rate[2]])
    rooms.append(bounds.surface_K_per_s)
    for flow in domain.flows:
        rows.append([flow.core, flow.coolant - flow.core, -flow.coolant])
        rooms.append(flow.largest - flow.inputs)
    ranges = [
        (box.surface_temperature_K[0] - reference_K, limits.max_core_temperature_K - reference_K),
        (box.surface_temperature_K[0] - reference_K, 0.0),
        (box.coolant_temperature_K[0] - reference_K, box.coolant_temperature_K[1] - reference_K),
    ]
    cooling = box.cooling_power_W[0] / domain.cell.coolant_heat_capacity_J_per_K
    pushed = rate_gain @ [
        bounds.core_K_per_s, bounds.surface_K_per_s, bounds.coolant_K_per_s - cooling,
    ]  # fmt: skip
    core_limit_K = limits.max_core_temperature_K - reference_K
    exceeded = []
    for row, limit_K in ((0, core_limit_K), (1, 0.0)):
        solution: Any = linprog(
            -state_gain[row], A_ub=np.array(rows), b_ub=np.array(rooms), bounds=ranges
        )
        exceeded.append(float(-solution.fun + pushed[row] - limit_K))
    return Overshoot(time_s, *exceeded)
