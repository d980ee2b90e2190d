"""Split-conformal bound: what held-out data say about data that nobody has seen yet."""

from __future__ import annotations

import math

import numpy as np

from bms.arrays import Array
from bms.bounds.record import Conformal
from bms.errors import InputError

CONFIDENCE = 0.95


def units_needed(confidence: float) -> int:
    """Fewest units from which a bound of this confidence can be had."""
    return math.ceil(confidence / (1.0 - confidence) - 1e-9)


def quantile_K(scores_K: Array, confidence: float) -> float:
    """The ceil((n + 1) confidence)-th smallest of n scores.

    A further score that is exchangeable with them stays below it with at least this probability.
    Raises InputError when n is too small. Source: Vovk, Gammerman, Shafer 2005, Algorithmic
    Learning in a Random World; finite-sample form as in Lei et al. 2018.
    """
    count = len(scores_K)
    rank = math.ceil((count + 1) * confidence - 1e-9)
    if rank > count:
        raise InputError(
            f"conformal bound: {count} held-out units are too few for a confidence of "
            f"{confidence:g}; give at least {units_needed(confidence)} or lower the confidence"
        )
    return float(np.sort(scores_K)[rank - 1])


def profile_scores_K(error_K: Array, profile: np.ndarray) -> Array:
    """Largest |error| of every profile, from errors and profile numbers (N,)."""
    _, number = np.unique(profile, return_inverse=True)
    scores = np.zeros(int(number.max()) + 1)
    np.maximum.at(scores, number, np.abs(error_K))
    return scores


def over_profiles(error_K: Array, profile: np.ndarray, confidence: float) -> Conformal:
    """Bound from errors (N,) of held-out profiles; InputError when they are too few."""
    scores_K = profile_scores_K(error_K, profile)
    return Conformal(quantile_K(scores_K, confidence), confidence, len(scores_K), "profile")


def over_blocks(error_K: Array, confidence: float) -> Conformal:
    """Bound from errors (N,) in time order, cut into as few and as long blocks as will do.

    The longer a block, the less it depends on its neighbours. InputError when N is too small.
    """
    count = min(units_needed(confidence), len(error_K))
    scores_K = np.array([np.abs(block).max() for block in np.array_split(error_K, count)])
    return Conformal(quantile_K(scores_K, confidence), confidence, count, "block")
