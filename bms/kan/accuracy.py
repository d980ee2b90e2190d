"""Error figures of an estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.validation import Count, Finite, NonNegative, strict


@strict
@dataclass(frozen=True)
class ErrorFigures:
    """Error of the estimate (estimate - truth) over some samples."""

    rmse_K: NonNegative
    max_abs_error_K: NonNegative
    bias_K: Finite
    samples: Count


def error_figures(estimate_K: Array, truth_K: Array) -> ErrorFigures:
    """Figures of estimate - truth, both (N,) in K."""
    error = estimate_K - truth_K
    return ErrorFigures(
        rmse_K=float(np.sqrt(np.mean(error**2))),
        max_abs_error_K=float(np.abs(error).max()),
        bias_K=float(error.mean()),
        samples=error.size,
    )
