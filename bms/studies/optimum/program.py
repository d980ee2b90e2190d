"""The relaxation as a convex program for cvxpy: the largest charge in a duration.

Its answer is trusted for nothing: the bound comes from `certificate`, to which this gives prices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm

from bms.arrays import Array
from bms.errors import InputError
from bms.studies.optimum.multipliers import Multipliers
from bms.studies.optimum.relaxation import Relaxation


@dataclass(frozen=True)
class Answer:
    """Largest charge in A s, its current (N,) in A and temperatures (N + 1, 3) in K, and prices."""

    charge_As: float
    current_A: Array
    temperatures_K: Array
    multipliers: Multipliers


def solver() -> Any:
    """The module cvxpy, slow to import; InputError that names the extra when it is missing."""
    try:
        import cvxpy  # noqa: PLC0415 (an optional extra, and slow to import)
    except ImportError:
        raise InputError(
            "optimum: cvxpy is not installed; pip install 'kan-rcbf-bms[bench]'"
        ) from None
    return cvxpy


def solve(relaxation: Relaxation) -> Answer:
    """Solve the program with piecewise constant current, limits held at the ends of samples.

    Raises InputError without cvxpy or when its solver finds no answer.
    """
    return _Program(relaxation, solver()).solve()


class _Program:
    def __init__(self, relaxation: Relaxation, cp: Any) -> None:
        self._cp, self._relaxation = cp, relaxation
        charge, ranges = relaxation.charge, relaxation.ranges
        count, step_s = ranges.samples, ranges.step_s
        self._current = cp.Variable(count, nonneg=True)
        self._heat, self._warmth = cp.Variable(count), cp.Variable(count)
        self._rise = cp.Variable((count + 1, 3))
        branches = charge.cell.branches
        self._polarisation = cp.Variable((count + 1, len(branches))) if branches else None
        after = cp.cumsum(self._current) * (step_s / charge.cell.capacity_As)
        self._soc = (
            charge.start_soc + after - self._current * (0.5 * step_s / charge.cell.capacity_As)
        )
        self._rules = [
            self._current <= ranges.strongest_A,
            self._rise[0] == 0.0,
            self._rise[1:] == self._next_rise(),
        ]
        self._hold_heat()
        limits = charge.limits
        self._core = self._rise[1:, 0] <= limits.max_core_temperature_K - charge.start_K
        self._surface = self._rise[1:, 1] <= limits.max_surface_temperature_K - charge.start_K
        self._voltage = self._hold_voltage()
        self._map = self._hold_map()
        self._ramp = self._hold_ramp()

    def _next_rise(self) -> Any:
        """Temperatures over the start's at the ends of samples, from those at their beginnings."""
        charge, step_s = self._relaxation.charge, self._relaxation.ranges.step_s
        drive = np.zeros((5, 5))
        drive[:3, :3] = charge.dynamics
        drive[:3, 3], drive[:3, 4] = charge.heating, charge.cooling
        step = expm(drive * step_s)
        cp, count = self._cp, self._relaxation.ranges.samples
        heat = cp.reshape(self._heat, (count, 1), order="C") @ step[None, :3, 3]
        return self._rise[:-1] @ step[:3, :3].T + heat + np.tile(step[:3, 4], (count, 1))

    def _hold_heat(self) -> None:
        cp, relaxation = self._cp, self._relaxation
        charge, ranges, current = relaxation.charge, relaxation.ranges, self._current
        lost = cp.multiply(ranges.resistance_ohm[0], cp.square(current))
        relaxed = 0.0
        if self._polarisation is not None:
            middle = 0.5 * (self._polarisation[1:] + self._polarisation[:-1])
            step_s = ranges.step_s
            self._rules.append(self._polarisation[0] == 0.0)
            for i, branch in enumerate(charge.cell.branches):
                kept = float(np.exp(-step_s / branch.time_constant_s))
                self._rules.append(
                    self._polarisation[1:, i]
                    == kept * self._polarisation[:-1, i]
                    + (1.0 - kept) * branch.resistance_ohm * current
                )
                lost = lost + cp.square(middle[:, i]) / branch.resistance_ohm
                relaxed = relaxed + middle[:, i]
        self._overvoltage = relaxed
        core_K = charge.start_K + 0.5 * (self._rise[1:, 0] + self._rise[:-1, 0])
        first_K, second_K = relaxation.anchor_K.T
        entropic = relaxation.entropic_V_per_K
        plane = cp.multiply(second_K, current) + cp.multiply(ranges.strongest_A, core_K - second_K)
        self._first = self._heat >= self._warmth + cp.multiply(entropic * first_K, current)
        self._second = self._heat >= self._warmth + cp.multiply(entropic, plane)
        self._rules += [self._warmth >= lost, self._first, self._second]
        if charge.current_map is not None:
            # Warmth opens the map, so that here heat must not come from nowhere.
            strongest = float(np.max(ranges.strongest_A))
            most_V = np.maximum(ranges.entropic_V_per_K[1], 0.0) * ranges.core_K[1]
            ohmic_V = ranges.resistance_ohm[1] * ranges.strongest_A
            self._rules.append(
                self._heat <= cp.multiply(ohmic_V + most_V, current) + strongest * relaxed
            )

    def _hold_voltage(self) -> list[Any]:
        ohm = self._relaxation.ranges.resistance_ohm[0]
        drop = self._cp.multiply(ohm, self._current) + self._overvoltage
        most_V = self._relaxation.charge.limits.max_voltage_V
        return [
            line[:, 0] + self._cp.multiply(line[:, 1], self._soc) + drop <= most_V
            for line in self._relaxation.voltage.transpose(1, 0, 2)
        ]

    def _hold_map(self) -> list[Any]:
        surface_K = self._relaxation.charge.start_K + 0.5 * (self._rise[1:, 1] + self._rise[:-1, 1])
        multiply = self._cp.multiply
        return [
            self._current
            <= plane[:, 0] + multiply(plane[:, 1], surface_K) + multiply(plane[:, 2], self._soc)
            for plane in self._relaxation.current_map.transpose(1, 0, 2)
        ]

    def _hold_ramp(self) -> list[Any]:
        growth = self._relaxation.charge.growth_A_per_s
        if growth is None:
            return []
        step_A = growth * self._relaxation.ranges.step_s
        return [
            self._current[0] <= 0.5 * step_A + growth * self._relaxation.charge.period_s,
            self._current[1:] - self._current[:-1] <= step_A,
        ]

    def solve(self) -> Answer:
        """Solve, and read current, temperatures and prices."""
        cp, ranges = self._cp, self._relaxation.ranges
        charged = cp.sum(self._current) * ranges.step_s
        rules = [self._core, self._surface, *self._voltage, *self._map, *self._ramp]
        problem = cp.Problem(cp.Maximize(charged), [*self._rules, *rules])
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.error.SolverError as error:
            raise InputError(
                f"optimum: the solver failed at {ranges.duration_s:.1f} s: {error}"
            ) from None
        if self._current.value is None:
            raise InputError(
                f"optimum: the solver found no charge of {ranges.duration_s:.1f} s "
                f"({problem.status})"
            )
        return Answer(
            charge_As=float(problem.value),
            current_A=np.asarray(self._current.value),
            temperatures_K=self._relaxation.charge.start_K + np.asarray(self._rise.value),
            multipliers=self._prices(),
        )

    def _prices(self) -> Multipliers:
        ranges, count = self._relaxation.ranges, self._relaxation.ranges.samples
        first, second = _dual(self._first), _dual(self._second)
        ramp = np.zeros(count + 1)
        if self._ramp:
            ramp[1:-1] = _dual(self._ramp[1])
            ramp[0] = float(_dual(self._ramp[0]).sum())
        polarisation = self._polarisation
        return Multipliers(
            core=_spread(_dual(self._core)) / ranges.step_s,
            surface=_spread(_dual(self._surface)) / ranges.step_s,
            voltage=_columns(self._voltage, count) / ranges.step_s,
            current_map=_columns(self._map, count) / ranges.step_s,
            ramp=ramp,
            core_share=second / np.maximum(first + second, 1e-300),
            polarisation_V=np.zeros((count + 1, 0))
            if polarisation is None
            else np.maximum(np.asarray(polarisation.value), 0.0),
        )


def _dual(rule: Any) -> Array:
    price: Array = np.maximum(np.asarray(rule.dual_value, dtype=float), 0.0)
    return price


def _columns(rules: list[Any], count: int) -> Array:
    return np.column_stack([_dual(rule) for rule in rules]) if rules else np.zeros((count, 0))


def _spread(at_ends: Array) -> Array:
    """Prices at the ends of samples, by halves to the samples on both sides; the last has one."""
    shared: Array = 0.5 * at_ends
    shared[1:] += 0.5 * at_ends[:-1]
    shared[-1] += 0.5 * at_ends[-1]
    return shared
