"""Tables of edges hold the spline exactly, and no rounding of the machine that made them."""

from __future__ import annotations

import numpy as np
import pytest

from bms.kan.network import Edge
from bms.tables.edge_polynomials import edge_polynomial

CUBIC = 3
KNOTS = (-2.5, -2.0, -1.5, -1.0, -0.25, 0.5, 1.0, 1.5, 2.0, 2.5)
"""Three cells from -1 to 1 of different width, and three knots more on each side."""
CELLS = ((-1.0, -0.25), (-0.25, 0.5), (0.5, 1.0))


def edge(base_weight: float) -> Edge:
    draw = np.random.default_rng(7)
    return Edge(KNOTS, base_weight, 0.8, tuple(draw.normal(size=6)))


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("base_weight", [0.0, 1.7])
def test_the_polynomial_is_the_edge_function(base_weight, cell):
    phi = edge(base_weight)
    found = np.polynomial.Polynomial(edge_polynomial(phi, CUBIC, *cell, 8))
    x = np.linspace(*cell, 101)
    difference = found(x - 0.5 * sum(cell)) - phi.evaluate(x, CUBIC)[0]
    assert np.max(np.abs(difference)) < (1e-8 if base_weight else 1e-14)


@pytest.mark.parametrize("cell", CELLS)
def test_a_spline_has_no_coefficient_above_its_degree(cell):
    coefficients = edge_polynomial(edge(0.0), CUBIC, *cell, 8)
    assert np.count_nonzero(coefficients[: CUBIC + 1]) == CUBIC + 1
    assert coefficients[CUBIC + 1 :] == [0.0] * 4


def test_a_part_of_a_cell_has_the_same_spline():
    whole = np.polynomial.Polynomial(edge_polynomial(edge(0.0), CUBIC, -1.0, -0.25, 8))
    part = np.polynomial.Polynomial(edge_polynomial(edge(0.0), CUBIC, -0.75, -0.5, 8))
    assert part(0.1) == pytest.approx(whole(-0.525 + 0.625), abs=1e-15)
