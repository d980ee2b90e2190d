"""The B-spline basis is SciPy's, on any rising knots, and silu is x times the logistic function."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.special import expit

from bms.kan.basis import basis, basis_slope, extended_knots, silu, silu_slope, uniform_knots

DEGREES = [1, 2, 3, 5]
GRIDS = [[-1.0, 1.0], [-1.0, 0.9, 1.0], [-0.4, -0.1, 0.3, 2.0, 2.1]]


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("grid", GRIDS)
def test_values_and_slopes_are_those_of_scipy(degree, grid):
    knots = extended_knots(np.array(grid), degree)
    # The slope of a linear spline jumps at its knots, so those are left out.
    x = np.setdiff1d(np.linspace(grid[0], grid[-1], 1001), knots)

    values, slopes = basis(x, knots, degree), basis_slope(x, knots, degree)

    count = len(grid) - 1 + degree
    assert values.shape == slopes.shape == (count, x.size)
    for row in range(count):
        oracle = BSpline(knots, np.eye(count)[row], degree)
        np.testing.assert_allclose(values[row], oracle(x), atol=1e-14)
        np.testing.assert_allclose(slopes[row], oracle.derivative()(x), rtol=1e-12, atol=1e-12)


@given(
    steps=st.lists(st.floats(0.01, 3.0), min_size=1, max_size=6),
    share=st.floats(0.0, 1.0),
    degree=st.sampled_from(DEGREES),
)
def test_basis_is_nonnegative_and_sums_to_one_everywhere_in_the_grid(steps, share, degree):
    grid = np.concatenate([[-1.0], -1.0 + np.cumsum(steps)])
    x = np.array([grid[0], grid[0] + share * (grid[-1] - grid[0]), grid[-1]])
    x = np.minimum(x, grid[-1])

    values = basis(x, extended_knots(grid, degree), degree)

    assert np.all(values >= 0.0)
    np.testing.assert_allclose(values.sum(axis=0), 1.0, atol=1e-12)


def test_extended_knots_keep_the_grid_and_add_degree_knots_on_each_side():
    knots = extended_knots(np.array([-1.0, 0.5, 1.0]), 3)

    np.testing.assert_allclose(knots, [-4.0, -3.0, -2.0, -1.0, 0.5, 1.0, 2.0, 3.0, 4.0])
    np.testing.assert_allclose(uniform_knots(-1.0, 1.0, 2, 1), [-2.0, -1.0, 0.0, 1.0, 2.0])


def test_silu_and_its_slope_also_far_from_zero():
    x = np.array([-1000.0, -40.0, -1.0, 0.0, 1.0, 40.0, 1000.0])
    sigmoid = expit(x)

    np.testing.assert_allclose(silu(x), x * sigmoid, atol=1e-13)
    np.testing.assert_allclose(silu_slope(x), sigmoid + x * sigmoid * (1.0 - sigmoid), atol=1e-13)
