"""The best elementary function for one edge.

In every form the outer factor and offset follow by linear least squares from what is inside, so
that only the inside is searched: from a fixed set of starts, then by SciPy's least_squares.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from bms.arrays import Array
from bms.studies.explanation.approximation import POLYNOMIALS, SHAPES, Approximation, rounded

RULE = (
    "of all forms the one with the fewest parameters whose RMSE is at most 1.25 times the smallest "
    "or below 1 mK; of several with as many parameters the one with the smallest RMSE"
)
_ABOUT_AS_GOOD = 1.25
_NEGLIGIBLE_K = 1e-3
_STILL_K = 1e-6
"""An edge that moves the estimate less than this is a constant, which then explains all of it."""
_ROOM = 1.25
"""Roots and logarithms stay defined this far from the middle, in half widths of the data."""
_STARTS_REFINED = 3


@dataclass(frozen=True)
class Candidate:
    """A form fitted to an edge; the RMSE is in kelvin of the estimate, weighted by the data."""

    approximation: Approximation
    rmse_K: float
    r_squared: float


@dataclass(frozen=True)
class _Inside:
    """Search space of what is inside of a form, in u = (x - middle)/half width: -1..1."""

    starts: tuple[tuple[float, ...], ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    columns: Callable[[Array, Array], Array]


def _grid(*axes: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    return tuple(itertools.product(*axes))


def _shaped(name: str) -> Callable[[Array, Array], Array]:
    return lambda u, p: SHAPES[name].function(p[0] * (u - p[1]))[None]


_RATES = (0.5, 1.0, 2.0, 4.0)
_SIGNED = (-4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0)
_PLACES = (-1.5, -0.75, 0.0, 0.75, 1.5)
_DISTANCES = (1.3, 1.6, 2.5, 5.0)
_INSIDE = {
    "exp": _Inside(_grid(_SIGNED), (-8.0,), (8.0,), lambda u, p: np.exp(p[0] * u)[None]),
    "sqrt": _Inside(_grid(_DISTANCES), (_ROOM,), (20.0,), lambda u, p: np.sqrt(u + p[0])[None]),
    "-sqrt": _Inside(_grid(_DISTANCES), (_ROOM,), (20.0,), lambda u, p: np.sqrt(p[0] - u)[None]),
    "log": _Inside(_grid(_DISTANCES), (_ROOM,), (20.0,), lambda u, p: np.log(u + p[0])[None]),
    "-log": _Inside(_grid(_DISTANCES), (_ROOM,), (20.0,), lambda u, p: np.log(p[0] - u)[None]),
    "sin": _Inside(
        _grid((0.7, 1.5, 2.5, 4.0)),
        (0.3,),
        (8.0,),
        lambda u, p: np.stack([np.sin(p[0] * u), np.cos(p[0] * u)]),
    ),
    "tanh": _Inside(_grid(_RATES, _PLACES), (0.3, -3.0), (20.0, 3.0), _shaped("tanh")),
    "gaussian": _Inside(_grid(_RATES, _PLACES), (0.3, -3.0), (20.0, 3.0), _shaped("gaussian")),
    "silu": _Inside(_grid(_RATES, _PLACES), (0.3, -3.0), (20.0, 3.0), _shaped("silu")),
    "-silu": _Inside(
        _grid(_RATES, _PLACES),
        (0.3, -3.0),
        (20.0, 3.0),
        lambda u, p: SHAPES["silu"].function(-p[0] * (u - p[1]))[None],
    ),
}


def candidates(x: Array, values: Array, weights_K2: Array) -> list[Candidate]:
    """Every form fitted to values (N,) at x (N,), the simplest first.

    A weight (N,) in K^2 is the share of the data at a point times the squared gain from the edge
    to the estimate, so that weighted squared errors add up to the mean square in kelvin.
    """
    low, high = float(x.min()), float(x.max())
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    found = []
    powers = len(POLYNOMIALS) if half > 1e-9 * max(1.0, abs(middle)) else 1
    u = (x - middle) / half if powers > 1 else np.zeros_like(x)
    roots = np.sqrt(weights_K2)
    for power in range(powers):
        solution = _solve(np.stack([u**n for n in range(1, power + 1)] or [0.0 * u]), values, roots)
        found.append(
            Approximation(
                POLYNOMIALS[power],
                rounded(middle),
                rounded(solution[-1]),
                tuple(rounded(c / half**n) for n, c in enumerate(solution[:power].tolist(), 1)),
            )
        )
    if powers > 1:
        found += [
            _shape(name, inside, u, values, roots, (middle, half))
            for name, inside in _INSIDE.items()
        ]
    scored = [_scored(approximation, x, values, weights_K2) for approximation in found]
    return sorted(
        (one for one in scored if math.isfinite(one.rmse_K)),
        key=lambda one: (one.approximation.parameters, one.rmse_K),
    )


def chosen(fitted: list[Candidate]) -> Candidate:
    """The candidate that RULE selects, from a list that `candidates` gave."""
    limit_K = max(_ABOUT_AS_GOOD * min(one.rmse_K for one in fitted), _NEGLIGIBLE_K)
    return next(one for one in fitted if one.rmse_K <= limit_K)


def _solve(columns: Array, values: Array, roots: Array) -> Array:
    """Factors of the columns (M, N) and, last, the offset."""
    design = np.vstack([columns, np.ones_like(values)]) * roots
    return np.asarray(np.linalg.lstsq(design.T, values * roots, rcond=None)[0], dtype=np.float64)


def _shape(
    name: str, inside: _Inside, u: Array, values: Array, roots: Array, place: tuple[float, float]
) -> Approximation:
    def residuals(parameters: Array) -> Array:
        columns = inside.columns(u, parameters)
        solution = _solve(columns, values, roots)
        misfit: Array = (solution[:-1] @ columns + solution[-1] - values) * roots
        return misfit

    ranked = sorted(inside.starts, key=lambda start: float(np.sum(residuals(np.array(start)) ** 2)))
    fits = [
        least_squares(residuals, start, bounds=(inside.low, inside.high))
        for start in ranked[:_STARTS_REFINED]
    ]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    solution = _solve(inside.columns(u, best), values, roots)
    return _physical(name, best.tolist(), solution.tolist(), *place)


def _physical(
    name: str, inside: list[float], outside: list[float], middle: float, half: float
) -> Approximation:
    """The form in x instead of u, with rounded numbers."""
    sign, form = (-1.0, name[1:]) if name.startswith("-") else (1.0, name)
    factor, offset = outside[0], outside[-1]
    if form == "exp":
        rate, center = inside[0] / half, middle
    elif form == "sin":
        phase = math.atan2(outside[1], outside[0])
        factor = math.hypot(outside[0], outside[1])
        rate, center = inside[0] / half, middle - phase * half / inside[0]
    elif form in ("sqrt", "log"):
        rate, center = sign / half, middle - sign * inside[0] * half
    else:
        rate, center = sign * inside[0] / half, middle + inside[1] * half
    return Approximation(form, rounded(center), rounded(offset), (rounded(factor),), rounded(rate))


def _scored(approximation: Approximation, x: Array, values: Array, weights_K2: Array) -> Candidate:
    with np.errstate(invalid="ignore", over="ignore"):
        squared = (approximation(x) - values) ** 2
    mean = float(np.sum(weights_K2 * values) / np.sum(weights_K2))
    spread = float(np.sum(weights_K2 * (values - mean) ** 2))
    error = float(np.sum(weights_K2 * squared))
    explained = 1.0 - error / spread if spread > _STILL_K**2 else 1.0
    # A constant explains nothing up to rounding, which may have either sign.
    return Candidate(approximation, math.sqrt(error), max(explained, 0.0))
