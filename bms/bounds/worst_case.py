"""Search for the charging profile on which the estimate is furthest from the truth.

Profiles begin at thermal rest anywhere in the operating box; then come a few currents between none
and the reference current, each held for a while, full steps included. What counts is every sample
whose estimate the firmware would trust and whose core is at most 2 K over its limit (the preset's
`core_limit_of_bound_K`): as long as the bound holds there, the controller keeps the cell there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count

import numpy as np
from scipy.optimize import differential_evolution

from bms.arrays import Array
from bms.bounds.record import WorstCase, WorstProfile
from bms.data.profiles import (
    CORE_LIMIT_BELOW_BOX_K,
    MAX_INITIAL_SOC,
    SAMPLE_PERIOD_S,
    Profiles,
    draw_profiles,
    start_range_K,
)
from bms.data.simulate import Samples, simulate
from bms.kan.network import Network
from bms.presets import Preset
from bms.progress import Progress, to_nobody

CORE_BEYOND_LIMIT_K = 2.0
_PIECES = 4
_DURATION_S = 300.0
_HOLD_S = (1.0, 200.0)
_VARIABLES = 4 + 2 * _PIECES
_CANDIDATES_PER_DRAWN = 5
_MUTATION = (0.2, 0.6)


@dataclass(frozen=True)
class Effort:
    """Size of a search: profiles in each generation (5 at least), and generations."""

    candidates: int = 400
    generations: int = 14

    def scaled(self, share: float) -> Effort:
        """The same with a share of candidates and generations, but as many as a search needs."""
        return Effort(
            max(math.ceil(share * self.candidates), 5), max(math.ceil(share * self.generations), 1)
        )


def worst_case(
    network: Network, preset: Preset, seed: int, effort: Effort, progress: Progress = to_nobody
) -> WorstCase:
    """Largest error found by differential evolution and by random profiles of full steps.

    All profiles of a generation are simulated at once, under the same noise in each.
    """

    def errors_K(profiles: Profiles) -> tuple[Samples, Array]:
        samples = simulate(preset, profiles, np.random.default_rng([seed, 1]), network.lags)
        return samples, _errors_K(network, preset, samples)

    generations = count(1)

    def cost(shares: Array) -> Array:
        samples, error_K = errors_K(_profiles(preset, shares.T))
        largest = np.zeros(shares.shape[1])
        np.maximum.at(largest, samples.profile, error_K)
        progress(next(generations) / (effort.generations + 1))
        return -largest

    start = np.random.default_rng([seed, 2]).random((effort.candidates, _VARIABLES))
    result = differential_evolution(
        cost,
        [(0.0, 1.0)] * _VARIABLES,
        init=start,
        maxiter=effort.generations,
        tol=0.0,
        mutation=_MUTATION,
        polish=False,
        updating="deferred",
        vectorized=True,
        seed=seed,
    )
    searched_K = -float(result.fun)
    rng = np.random.default_rng([seed, 3])
    drawn = draw_profiles(preset, "steps", effort.candidates // _CANDIDATES_PER_DRAWN, rng)
    random_K = float(errors_K(drawn)[1].max())
    profiles = _profiles(preset, result.x[None])
    samples, error_K = errors_K(profiles)
    return WorstCase(
        max(searched_K, random_K),
        searched_K,
        random_K,
        _described(preset, result.x),
        float(samples.time_s[np.argmax(error_K)]),
        effort.candidates * (effort.generations + 1) + len(drawn.initial_soc),
    )


def _errors_K(network: Network, preset: Preset, samples: Samples) -> Array:
    """|estimate - truth| (N,) where the estimate is trusted and the cell not too hot, else 0."""
    estimate_K, in_domain = network.evaluate(samples.inputs)
    hottest_K = preset.core_limit_of_bound_K + CORE_BEYOND_LIMIT_K
    counts = in_domain & (samples.core_temperature_K <= hottest_K)
    return np.abs(estimate_K - samples.core_temperature_K) * counts


def _profiles(preset: Preset, shares: Array) -> Profiles:
    """Profiles for rows of shares 0..1, (P, _VARIABLES)."""
    box = preset.operating_box
    current_A, hold_s = _pieces(preset, shares)
    ends_s = np.cumsum(hold_s, axis=1)[:, :-1]
    time_s = np.arange(0.0, _DURATION_S, SAMPLE_PERIOD_S)
    piece = (time_s[None, :, None] >= ends_s[:, None, :]).sum(axis=2)
    return Profiles(
        "steps",
        np.take_along_axis(current_A, piece, axis=1),
        _between(shares[:, 1], box.cooling_power_W),
        _between(shares[:, 0], start_range_K(preset)),
        _between(shares[:, 2], (0.0, MAX_INITIAL_SOC)),
        _core_limit_K(preset, shares[:, 3]),
    )


def _pieces(preset: Preset, shares: Array) -> tuple[Array, Array]:
    """Currents in A and how long each is held in s, both (P, pieces)."""
    # Half of all draws are an end of the range, so that full steps are common.
    level = np.clip(2.0 * shares[:, 4 : 4 + _PIECES] - 0.5, 0.0, 1.0)
    shortest, longest = np.log(_HOLD_S)
    hold_s = np.exp(_between(shares[:, 4 + _PIECES :], (shortest, longest)))
    return level * preset.limits.reference_current_A, hold_s


def _core_limit_K(preset: Preset, share: Array) -> Array:
    """Limit at which the current is derated; none for half of the shares."""
    near_K, far_K = CORE_LIMIT_BELOW_BOX_K
    below_K = _between(2.0 * share, (near_K, far_K))
    return np.where(share > 0.5, np.inf, preset.operating_box.surface_temperature_K[1] - below_K)


def _described(preset: Preset, shares: Array) -> WorstProfile:
    profile = _profiles(preset, shares[None])
    current_A, hold_s = _pieces(preset, shares[None])
    limit_K = float(profile.core_limit_K[0])
    return WorstProfile(
        float(profile.initial_temperature_K[0]),
        float(profile.initial_soc[0]),
        float(profile.cooling_power_W[0]),
        limit_K if np.isfinite(limit_K) else None,
        tuple(current_A[0].tolist()),
        tuple(hold_s[0].tolist()),
    )


def _between(share: Array, ends: tuple[float, float]) -> Array:
    return ends[0] + share * (ends[1] - ends[0])
