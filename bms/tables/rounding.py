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

from bms.kan.network import Network
from bms.tables.network_tables import Array, EdgeTable, NetworkTables, network_tables

UNIT = 2.0**-24
"""Largest relative error of rounding to float32."""
_SECOND_ORDER = 1.0 + 1e-5


@dataclass(frozen=True)
class EdgeBound:
    """Bounds on one edge, in the unit of its value: of its error, and of its magnitude."""

    error: float
    magnitude: float


def edge_bounds(tables: NetworkTables) -> tuple[EdgeBound, ...]:
    """Bounds on |C - double| of every edge for one and the same float32 argument."""
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
    return EdgeBound(edge.worst_error + _SECOND_ORDER * max(errors), max(magnitudes))


def _horner(coefficients: Array, distance: float) -> tuple[float, float]:
    """Bounds on value and rounding error of Horner's rule, for magnitudes of the coefficients."""
    size = float(coefficients[-1])
    error = UNIT * size
    for coefficient in coefficients[-2::-1].tolist():
        product = size * distance
        size = product + coefficient
        error = error * distance + UNIT * (product + coefficient + size)
    return size, error


def arithmetic_error_K(network: Network) -> float:
    """Bound on |C - double| of the whole estimate in K, for inputs within the trained box.

    Includes the rounding of the inputs themselves to float32. InputError when the network exceeds
    the firmware's maxima.
    """
    tables = network_tables(network)
    bounds = edge_bounds(tables)
    half_range = np.asarray(network.input_half_range)
    center = np.abs(np.asarray(network.input_center))
    reached = half_range * network.reach
    # Input, stored centre and difference; then stored scale and product.
    scaling = UNIT * (center + reached + center + reached) / half_range
    errors: Array = scaling + 2.0 * UNIT * network.reach
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
    output_K = UNIT * (2.0 * abs(network.output_center_K) + 3.0 * span_K * magnitude)
    return _SECOND_ORDER * (span_K * float(errors[0]) + output_K)
