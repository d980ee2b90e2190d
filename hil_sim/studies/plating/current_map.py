"""The current map under which the anode of an electrochemical model keeps a potential."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import linprog

from bms.arrays import Array
from bms.presets.schema import CurrentMap
from hil_sim.studies.plating.charges import Anode, least_anode_potential_V, strongest_currents

BETWEEN = 3
"""Parts of the way from one temperature of the map to the next, at whose ends it has to hold."""
RESOLUTION_A = 0.1
_ALLOWED = 1e-9


@dataclass(frozen=True)
class Check:
    """A charge at the map's currents: least anode potential, and where it is."""

    temperature_K: float
    soc: float
    anode_potential_V: float


@dataclass(frozen=True)
class Plating:
    """A current map and the charges at its currents, one at each temperature that was looked at."""

    map: CurrentMap
    checks: tuple[Check, ...]


def derive_map(
    cell: Anode,
    temperatures_K: Sequence[float],
    charges: Sequence[float],
    most_A: float,
    margin_V: float = 0.0,
    advance: Callable[[], None] = lambda: None,
) -> Plating:
    """The largest current map whose values stay below the currents at which lithium plates.

    These are looked for at the map's temperatures (K) and at others between them. `advance` is
    called after each of `steps(temperatures_K)` charges. Raises InputError for axes that do not
    rise, PlantError where the model has no solution.
    """
    CurrentMap(
        tuple(temperatures_K), tuple(charges), ((0.0,) * len(charges),) * len(temperatures_K)
    )
    looked_at_K = _between(temperatures_K)
    limits = []
    for temperature_K in looked_at_K:
        soc, strength_A = strongest_currents(cell, temperature_K, margin_V, most_A)
        limits += [(temperature_K, s, a) for s, a in zip(soc.tolist(), strength_A.tolist())]
        limits.append((temperature_K, 0.0, float(strength_A[0])))
        if strength_A[-1] == 0.0:
            limits += [(temperature_K, s, 0.0) for s in charges if s > soc[-1]]
        advance()
    found = _largest_below(np.array(limits), temperatures_K, charges, most_A)
    checks = []
    for temperature_K in looked_at_K:
        least_V, soc_there = least_anode_potential_V(
            cell, temperature_K, partial(mapped_A, found, temperature_K)
        )
        checks.append(Check(temperature_K, soc_there, least_V))
        advance()
    return Plating(found, tuple(checks))


def steps(temperatures_K: Sequence[float]) -> int:
    """Charges that a map takes."""
    return 2 * len(_between(temperatures_K))


def mapped_A(table: CurrentMap, temperature_K: float, soc: float) -> float:
    """Strongest charging current in A, as the firmware reads it from the map."""
    by_temperature = [np.interp(soc, table.soc, row) for row in table.largest_A]
    return float(np.interp(temperature_K, table.temperature_K, by_temperature))


def _between(temperatures_K: Sequence[float]) -> list[float]:
    shares = [number / BETWEEN for number in range(BETWEEN)]
    return [
        low + share * (high - low)
        for low, high in itertools.pairwise(temperatures_K)
        for share in shares
    ] + [temperatures_K[-1]]


def _largest_below(
    limits: Array, temperatures_K: Sequence[float], charges: Sequence[float], most_A: float
) -> CurrentMap:
    """The map of largest sum that stays below limits (N, 3) of temperature, charge and current.

    A linear programme: interpolation is linear in the values, and so is what a map may not do, to
    rise with the charge or to fall with the temperature.
    """
    rows, columns = len(temperatures_K), len(charges)
    weights = np.einsum(
        "nt,ns->nts",
        _shares(temperatures_K, limits[:, 0]),
        _shares(charges, limits[:, 1]),
    ).reshape(len(limits), -1)
    number = np.arange(rows * columns).reshape(rows, columns)
    smaller = np.concatenate([number[:, 1:].ravel(), number[:-1].ravel()])
    larger = np.concatenate([number[:, :-1].ravel(), number[1:].ravel()])
    unit = np.eye(rows * columns)
    solution = linprog(
        -np.ones(rows * columns),
        A_ub=np.concatenate([weights, unit[smaller] - unit[larger]]),
        b_ub=np.concatenate([limits[:, 2], np.zeros(len(smaller))]),
        bounds=(0.0, most_A),
        method="highs",
    )
    assert solution.success, solution.message
    values = solution.x.reshape(rows, columns)
    return CurrentMap(
        tuple(temperatures_K),
        tuple(charges),
        tuple(tuple(_down(value) for value in row) for row in values.tolist()),
    )


def _shares(axis: Sequence[float], at: Array) -> Array:
    """Weight (N, points) of each point of an axis in a linear interpolation at values (N,)."""
    return np.stack([np.interp(at, axis, unit) for unit in np.eye(len(axis))], axis=1)


def _down(value_A: float) -> float:
    return round(math.floor(value_A / RESOLUTION_A + _ALLOWED) * RESOLUTION_A, 6)
