"""Polynomials of an edge function, in decimal arithmetic.

The tables are checked in and compared byte for byte, so they must not depend on the processor's
vector units or on how a linear-algebra library adds up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Context, Decimal, localcontext

from bms.kan.network import Edge

_PRECISION = Context(prec=50)
_NODE_DIGITS = 12
_NOTHING = Decimal("1e-40")
"""What the precision leaves of a coefficient that is none."""


def edge_polynomial(
    edge: Edge, degree: int, low: float, high: float, coefficients: int
) -> list[float]:
    """Interpolant of the edge at Chebyshev nodes between `low` and `high`, within one grid cell.

    Coefficients in the distance from the middle, constant term first.
    """
    with localcontext(_PRECISION):
        middle = (Decimal(low) + Decimal(high)) / 2
        half = (Decimal(high) - Decimal(low)) / 2
        distances = [half * node for node in _chebyshev_nodes(coefficients)]
        values = [_value(edge, degree, middle + distance) for distance in distances]
        found = _interpolant(distances, values)
        return [float(each) if abs(each) > _NOTHING else 0.0 for each in found]


def _chebyshev_nodes(count: int) -> list[Decimal]:
    """Rounded, because mathematical libraries differ in their last digits."""
    angles = (math.pi * (2 * k + 1) / (2 * count) for k in range(count))
    return [Decimal(f"{math.cos(angle):.{_NODE_DIGITS}f}") for angle in angles]


def _value(edge: Edge, degree: int, x: Decimal) -> Decimal:
    silu = x / (1 + (-x).exp())
    return Decimal(edge.base_weight) * silu + Decimal(edge.spline_weight) * _spline(edge, degree, x)


def _spline(edge: Edge, degree: int, x: Decimal) -> Decimal:
    """De Boor's recursion on the grid interval that holds x."""
    knots = [Decimal(knot) for knot in edge.knots]
    last = len(knots) - degree - 2
    k = next((i for i in range(degree, last) if x < knots[i + 1]), last)
    points = [Decimal(edge.coefficients[k - degree + j]) for j in range(degree + 1)]
    for r in range(1, degree + 1):
        for j in range(degree, r - 1, -1):
            left, right = knots[k - degree + j], knots[k + 1 + j - r]
            share = (x - left) / (right - left)
            points[j] = (1 - share) * points[j - 1] + share * points[j]
    return points[degree]


def _interpolant(nodes: Sequence[Decimal], values: Sequence[Decimal]) -> list[Decimal]:
    """Newton's divided differences, expanded in powers."""
    differences = list(values)
    for order in range(1, len(nodes)):
        for i in range(len(nodes) - 1, order - 1, -1):
            rise = differences[i] - differences[i - 1]
            differences[i] = rise / (nodes[i] - nodes[i - order])
    powers = [Decimal(0)] * len(nodes)
    for node, difference in zip(reversed(nodes), reversed(differences)):
        powers = [
            (powers[i - 1] if i else Decimal(0)) - node * powers[i] for i in range(len(nodes))
        ]
        powers[0] += difference
    return powers
