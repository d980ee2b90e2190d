"""A shrinking-horizon model-predictive charge: the rival that knows everything.

Every REPLANNED_S it takes the true state, predicts with the true cell and solves a convex program
(cvxpy with Clarabel) for the largest charge until its horizon ends. The horizon is the least in
which the cell becomes full, so that it shrinks from plan to plan. It has the limits of the others
and the charger's ramp, less MARGINS for what happens between its samples.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from bms.arrays import Array
from bms.decision import INVALID, NO_MARGINS, Decision, Observation
from bms.errors import InputError
from bms.presets import Preset
from bms.studies.optimum.charge import Charge, charge_of
from bms.studies.optimum.program import solver
from bms.studies.optimum.ranges import voltage_lines

SAMPLES = 60
REPLANNED_S = 10.0


class Margins(NamedTuple):
    """What is kept free of the limits of both temperatures and of the voltage."""

    temperature_K: float
    voltage_V: float


MARGINS = Margins(0.02, 0.001)
_FIRST_HORIZONS = 8
_SHORTEST_S = 1.0
_LEVEL_K = 300.0
"""Temperatures of the program count from here, for its numbers' sake."""
_CONVEX_FROM_SOC = 0.2
"""Below it the voltage is far from its limit, and only bends the envelope."""


class Plan(NamedTuple):
    """Currents (N,) in A of equal samples of a horizon, the core (N,) in K, and the charge."""

    horizon_s: float
    current_A: Array
    core_K: Array
    charge_As: float


class Program:
    """The convex program, compiled once and solved for many states and horizons."""

    def __init__(self, charge: Charge, samples: int = SAMPLES) -> None:
        """Raises InputError without cvxpy, and for a cell that is not one of constants."""
        cell, limits = charge.cell, charge.limits
        if cell.entropy is not None or cell.resistance is not None or cell.branches:
            raise InputError("the predictive rival: only for a cell of constant parameters")
        self._cp = cp = solver()
        self._charge, self._samples = charge, samples
        self._current = cp.Variable(samples, nonneg=True)
        heat, level = cp.Variable(samples), cp.Variable((samples + 1, 3))
        self._level = level
        self._turn = cp.Parameter((3, 3))
        self._heating, self._cooling = cp.Parameter((1, 3)), cp.Parameter((1, 3))
        self._first = cp.Parameter(3)
        self._entropic_V = cp.Parameter(samples)
        self._soc, self._share_per_A = cp.Parameter(), cp.Parameter(nonneg=True)
        self._step_A, self._first_A = cp.Parameter(nonneg=True), cp.Parameter(nonneg=True)
        ones = np.ones((samples, 1))
        soc = self._soc + self._share_per_A * cp.cumsum(self._current)
        drop = cell.ohmic_resistance_ohm * self._current
        rules = [
            self._current <= charge.strongest_A,
            level[0] == self._first,
            level[1:]
            == level[:-1] @ self._turn
            + cp.reshape(heat, (samples, 1), order="C") @ self._heating
            + ones @ self._cooling,
            heat
            >= cell.ohmic_resistance_ohm * cp.square(self._current)
            + cp.multiply(self._entropic_V, self._current),
            level[1:, 0] <= limits.max_core_temperature_K - MARGINS.temperature_K - _LEVEL_K,
            level[1:, 1] <= limits.max_surface_temperature_K - MARGINS.temperature_K - _LEVEL_K,
            self._current[0] <= self._first_A,
            self._current[1:] - self._current[:-1] <= self._step_A,
        ]
        lowest = max(charge.start_soc, _CONVEX_FROM_SOC)
        for height_V, slope_V in voltage_lines(cell, (lowest, limits.max_soc)).tolist():
            rules.append(
                height_V + slope_V * soc + drop <= limits.max_voltage_V - MARGINS.voltage_V
            )
        self._problem = cp.Problem(cp.Maximize(cp.sum(self._current)), rules)

    def solve(
        self, state: Observation, before_A: float, horizon_s: float, core_K: Array
    ) -> Plan | None:
        """The largest charge of a horizon from a state; None where the solver finds none.

        `before_A` is the current until now, core_K (N,) the core that reversible heat counts with.
        """
        charge, step_s = self._charge, horizon_s / self._samples
        drive = np.zeros((5, 5))
        drive[:3, :3] = charge.dynamics
        drive[:3, 3], drive[:3, 4] = charge.heating, charge.cooling
        step = expm(drive * step_s)
        self._turn.value = step[:3, :3].T
        self._heating.value, self._cooling.value = step[None, :3, 3], step[None, :3, 4]
        self._first.value = np.array(state[1:4]) - _LEVEL_K
        self._entropic_V.value = charge.cell.entropic_coefficient_V_per_K * core_K
        self._soc.value = state.soc
        self._share_per_A.value = step_s / charge.cell.capacity_As
        growth_A = (charge.growth_A_per_s or math.inf) * step_s
        self._step_A.value = min(growth_A, charge.strongest_A)
        self._first_A.value = min(before_A + growth_A, charge.strongest_A)
        try:
            self._problem.solve(solver=self._cp.CLARABEL)
        except self._cp.error.SolverError:
            return None
        if self._current.value is None:
            return None
        current_A = np.maximum(np.asarray(self._current.value), 0.0)
        cores_K = np.asarray(self._level.value)[1:, 0] + _LEVEL_K
        return Plan(horizon_s, current_A, cores_K, float(current_A.sum()) * step_s)


class PredictiveController:
    """The rival as a controller of one cell whose true state it sees; an object charges once."""

    name = "mpc"

    def __init__(self, preset: Preset) -> None:
        """Controller for a preset's cell; raises InputError as Program does."""
        self._preset, self._charge = preset, charge_of(preset)
        self._program = Program(self._charge)
        self._plan: Plan | None = None
        self._age_s = 0.0
        self._slope_A = 0.5 * self._charge.strongest_A
        self._before_A = 0.0

    def decide(self, observation: Observation) -> Decision:
        """Charging current of the plan, no stronger than voltage and ramp allow at this instant."""
        if not all(map(math.isfinite, observation[:4])):
            return INVALID
        if self._plan is None:
            self._plan = self._first_plan(observation)
        elif self._age_s >= REPLANNED_S - 1e-9:
            self._plan = self._next_plan(observation, self._plan)
        wanted_A = {"none": self._planned_A(), "voltage": self._voltage_A(observation)}
        if self._charge.growth_A_per_s is not None:
            period_A = self._charge.growth_A_per_s * self._charge.period_s
            wanted_A["none"] = min(wanted_A["none"], self._before_A + period_A)
        active = min(wanted_A, key=wanted_A.__getitem__)
        self._before_A = max(wanted_A[active], 0.0)
        self._age_s += self._charge.period_s
        current_A = -self._before_A
        return Decision(current_A, True, active, current_A, 0.0, NO_MARGINS)

    def _planned_A(self) -> float:
        if self._plan is None:
            return 0.0
        step_s = self._plan.horizon_s / len(self._plan.current_A)
        sample = min(int(self._age_s / step_s + 1e-9), len(self._plan.current_A) - 1)
        return float(self._plan.current_A[sample])

    def _voltage_A(self, observation: Observation) -> float:
        """Strongest current that keeps the voltage until the end of the period."""
        cell = self._charge.cell
        share = self._charge.strongest_A * self._charge.period_s / cell.capacity_As
        most_V = self._preset.limits.max_voltage_V - MARGINS.voltage_V
        room_V = most_V - float(cell.ocv(observation.soc + share))
        return room_V / cell.ohmic_resistance_ohm

    def _needed_As(self, observation: Observation) -> float:
        lack = self._preset.limits.completion_soc - observation.soc
        return max(lack, 0.0) * self._charge.cell.capacity_As

    def _first_plan(self, observation: Observation) -> Plan | None:
        """The horizon by a secant from the shortest that is conceivable."""
        needed_As = self._needed_As(observation)
        core_K = np.full(SAMPLES, self._preset.limits.max_core_temperature_K)
        horizon_s = max(needed_As / self._charge.strongest_A, _SHORTEST_S)
        plan = None
        for _ in range(_FIRST_HORIZONS):
            tried = self._program.solve(observation, self._before_A, horizon_s, core_K)
            if tried is None:
                break
            if plan is not None and abs(tried.horizon_s - plan.horizon_s) > 1e-3:
                slope_A = (tried.charge_As - plan.charge_As) / (tried.horizon_s - plan.horizon_s)
                least_A = 0.02 * self._charge.strongest_A
                self._slope_A = min(max(slope_A, least_A), self._charge.strongest_A)
            plan, core_K = tried, tried.core_K
            lack_As = needed_As - tried.charge_As
            if abs(lack_As) < 1e-4 * needed_As:
                break
            horizon_s += lack_As / self._slope_A
        self._age_s = 0.0
        return plan

    def _next_plan(self, observation: Observation, before: Plan) -> Plan:
        """From here to the same end, which the lack of the last plan moves; else the plan so far.

        A plan that is not found leaves the one before it in force.
        """
        needed_As = self._needed_As(observation)
        horizon_s = max(before.horizon_s - self._age_s, _SHORTEST_S)
        times_s = (np.arange(SAMPLES) + 0.5) / SAMPLES
        core_K = np.interp(
            self._age_s + times_s * horizon_s, times_s * before.horizon_s, before.core_K
        )
        plan = self._program.solve(observation, self._before_A, horizon_s, core_K)
        if plan is not None:
            shift_s = (needed_As - plan.charge_As) / self._slope_A
            horizon_s = max(horizon_s + shift_s, _SHORTEST_S)
            plan = self._program.solve(observation, self._before_A, horizon_s, plan.core_K)
        if plan is None:
            return before
        self._age_s = 0.0
        return plan
