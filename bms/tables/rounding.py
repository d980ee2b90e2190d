"""Proven bounds on what tables and float32 arithmetic add to the error of the estimate.

Running error analysis of the firmware's operations: each of + - * and each constant that is stored
as float32 is off by at most half a unit in the last place. `bms verify-tables` holds the bounds of
the edges against every argument there is. Source: Higham, Accuracy and Stability of Numerical
Algorithms, sections 2.2 and 5.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bms.arrays import Array
from bms.barrier.rounding import UNIT
from bms.data.lags import Lag
from bms.errors import InputError
from bms.kan.network import INPUT_NAMES, Network
from bms.tables.network_tables import EdgeTable, NetworkTables, network_tables

PERIOD_S = 0.1
"""Control period for which the rounding of the filters of lagged inputs is bounded."""
_SECOND_ORDER = 1.0 + 1e-5


@dataclass(frozen=True)
class EdgeBound:
    """Bounds on one edge, in the unit of its value: of its error, and of its magnitude."""

    error: float
    magnitude: float


def edge_error_bounds(network: Network) -> tuple[float, ...]:
    """Bound on |C - double| of every edge for one and the same float32 argument.

    In the unit of the edge's value and the firmware's order. InputError when the network exceeds
    the firmware's maxima.
    """
    return tuple(bound.error for bound in _edge_bounds(network_tables(network)))


def fits_firmware(network: Network) -> bool:
    """Whether the firmware can hold the network, so that it has tables to speak of."""
    try:
        network_tables(network)
    except InputError:
        return False
    return True


def arithmetic_error_K(network: Network, period_s: float = PERIOD_S) -> float:
    """Bound on |C - double| of the whole estimate in K, for inputs within the trained box.

    Includes the rounding of the inputs themselves, and of the filters that run every `period_s`.
    InputError when the network exceeds the firmware's maxima.
    """
    tables = network_tables(network)
    bounds = _edge_bounds(tables)
    errors = _node_errors(network, period_s)
    position, magnitude = 0, 0.0
    for layer in network.layers:
        following = []
        for row in layer:
            own = slice(position, position + len(row))
            position += len(row)
            magnitude = sum(bound.magnitude for bound in bounds[own])
            # Every partial sum is rounded once.
            total = len(row) * UNIT * magnitude
            for bound, edge, error in zip(bounds[own], tables.edges[own], errors):
                total += bound.error + edge.steepest * error
            following.append(total)
        errors = np.asarray(following)
    span_K = network.output_half_range_K
    # Stored centre and half range, product and sum.
    output_K = UNIT * (2.0 * abs(network.output_center_K) + 4.0 * span_K * magnitude)
    return float(_SECOND_ORDER * (span_K * errors[0] + output_K))


def _edge_bounds(tables: NetworkTables) -> tuple[EdgeBound, ...]:
    return tuple(_edge_bound(edge) for edge in tables.edges)


def _edge_bound(edge: EdgeTable) -> EdgeBound:
    errors, magnitudes = [], []
    for (low, high), coefficients in zip(pairwise(edge.knots), edge.coefficients):
        half = 0.5 * (high - low) * (1.0 + 4.0 * UNIT)
        size, error = _horner(np.abs(coefficients), half)
        # The firmware's middle and distance are rounded, and so are the ends of the grid.
        argument = UNIT * (2.0 * max(abs(low), abs(high)) + half)
        errors.append(error + edge.steepest * argument)
        magnitudes.append(size)
    bound = edge.worst_error + _SECOND_ORDER * max(errors)
    return EdgeBound(float(bound), float(max(magnitudes)))


def _horner(coefficients: Array, distance: float) -> tuple[float, float]:
    """Bounds on value and rounding error of Horner's rule, for magnitudes of the coefficients."""
    size = float(coefficients[-1])
    error = UNIT * size
    for coefficient in coefficients[-2::-1].tolist():
        product = size * distance
        size = product + coefficient
        error = error * distance + UNIT * (product + coefficient + size)
    return size, error


def _node_errors(network: Network, period_s: float) -> Array:
    """Bounds on the errors of the scaled inputs, (n_in,)."""
    half_range = np.asarray(network.input_half_range)
    largest = np.abs(np.asarray(network.input_center)) + network.reach * half_range
    errors = UNIT * largest
    for place, lag in enumerate(network.lags, start=len(INPUT_NAMES)):
        errors[place] = _filter_error(lag, largest, place, period_s)
    # Stored centre and difference; then stored scale, and product.
    scaling = UNIT * (2.0 * largest / half_range + 2.0 * network.reach)
    return np.asarray(errors / half_range + scaling)


def _filter_error(lag: Lag, largest: Array, place: int, period_s: float) -> float:
    """Bound on the rounding error of a filter's value, which forgets its past by its decay.

    Each step rounds the decay, the gain, their products and the sum; what a step adds is no more
    than the filter's largest value.
    """
    fresh = 1.0 - lag.decay(period_s)
    own = 5.0 * UNIT * largest[place] / fresh
    if lag.quantity == "current_squared_A2":
        return float(own + 5.0 * UNIT * largest[0] ** 2)
    # Differences of neighbouring readings are exact; their rounding errors cancel but for two.
    return float(own + 4.0 * UNIT * largest[2])
