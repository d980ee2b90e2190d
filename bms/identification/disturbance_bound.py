"""A bound on a disturbance that may grow with the current, and what it is worth on unseen data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import eye_array, hstack

from bms.arrays import Array
from bms.errors import InputError

SHARE = 0.999
"""Of the moments, which a bound covers."""
QUANTILES = (0.5, 0.95, 0.99, SHARE)
STRETCHES = 19
"""Of a recording; the largest of 19 scores is a conformal bound at 19/20."""
_SMALLEST_K_PER_S = 1e-9


@dataclass(frozen=True)
class Growth:
    """constant + per_A |u| + per_A2 u^2 in K/s, of a current u in A."""

    constant_K_per_s: float
    per_A_K_per_As: float = 0.0
    per_A2_K_per_A2s: float = 0.0

    def __call__(self, current_A: Array) -> Array:
        """Bound in K/s at currents of any shape."""
        strength_A = np.abs(current_A)
        bound: Array = self.constant_K_per_s + strength_A * (
            self.per_A_K_per_As + self.per_A2_K_per_A2s * strength_A
        )
        return bound

    def scaled(self, factor: float) -> Growth:
        """All three times a factor."""
        return Growth(
            factor * self.constant_K_per_s,
            factor * self.per_A_K_per_As,
            factor * self.per_A2_K_per_A2s,
        )


@dataclass(frozen=True)
class DisturbanceBound:
    """Bound on one disturbance, from its rates over a recording.

    `fitted` covers SHARE of the recording. A stretch is covered as far as `coverage` says by the
    bound that the others give. `factor` on `fitted` covers SHARE of each; so it does, with
    probability `confidence`, of a further stretch that is exchangeable with them.
    """

    quantiles_K_per_s: tuple[float, ...]
    fitted: Growth
    coverage: tuple[float, ...]
    factor: float
    confidence: float

    @property
    def conformal(self) -> Growth:
        """The fitted bound times the factor."""
        return self.fitted.scaled(self.factor)


def disturbance_bound(rate_K_per_s: Array, current_A: Array, *, grows: bool) -> DisturbanceBound:
    """Bound on |rate| (N,) at currents (N,) in time order; a constant one unless it `grows`.

    Source: leave-one-out conformal prediction with the ratio to the bound as score (Barber et al.
    2021, the jackknife's variants). Raises InputError for fewer rows than stretches.
    """
    size = np.abs(rate_K_per_s)
    if len(size) < STRETCHES:
        raise InputError(f"{len(size)} rows; a bound on the disturbance needs {STRETCHES}")
    coverage, scores = [], []
    for left_out in np.array_split(np.arange(len(size)), STRETCHES):
        others = np.delete(np.arange(len(size)), left_out)
        bound = _covering(size[others], current_A[others], grows=grows)(current_A[left_out])
        ratio = size[left_out] / np.maximum(bound, _SMALLEST_K_PER_S)
        coverage.append(float(np.mean(ratio <= 1.0)))
        scores.append(float(np.quantile(ratio, SHARE, method="higher")))
    return DisturbanceBound(
        tuple(np.quantile(size, QUANTILES).tolist()),
        _covering(size, current_A, grows=grows),
        tuple(coverage),
        max(1.0, *scores),
        STRETCHES / (STRETCHES + 1),
    )


def _covering(size_K_per_s: Array, current_A: Array, *, grows: bool) -> Growth:
    """The least bound that covers SHARE of the sizes (N,): regression of this quantile.

    The linear programme min (1 - SHARE) sum b_i + sum s_i with s_i >= size_i - b_i, s_i >= 0 and
    coefficients >= 0, whose solution for a constant is the quantile. Source: Koenker, Bassett 1978.
    """
    if not grows:
        return Growth(float(np.quantile(size_K_per_s, SHARE, method="higher")))
    strongest_A = float(np.max(np.abs(current_A))) or 1.0
    powers = np.arange(3)
    terms = (np.abs(current_A)[:, None] / strongest_A) ** powers
    count = len(size_K_per_s)
    unit = float(np.max(size_K_per_s)) or 1.0
    solution = linprog(
        np.concatenate([(1.0 - SHARE) * terms.sum(axis=0), np.ones(count)]),
        A_ub=-hstack([terms, eye_array(count)], format="csr"),
        b_ub=-size_K_per_s / unit,
        method="highs",
    )
    assert solution.success, solution.message
    coefficients = unit * solution.x[: len(powers)] / strongest_A**powers
    return Growth(*coefficients.tolist())
