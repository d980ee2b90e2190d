"""Disturbances stay within the preset's bounds, use them fully, and repeat with their seed."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.presets import load_preset
from hil_sim.plant.disturbances import DisturbanceKind, disturbance_source

STEP_S = 0.01
KNOTS = 20_000
PRESET = load_preset("paper_calibrated")


def bounds(preset):
    u = preset.uncertainty
    return np.array([u.soc_per_s, u.core_K_per_s, u.surface_K_per_s, u.coolant_K_per_s])


def knots(kind, preset=PRESET, seed=0, count=KNOTS):
    source = disturbance_source(kind, preset, STEP_S, np.random.default_rng(seed))
    return np.array(list(itertools.islice(source, count)))


def with_uncertainty(**changes):
    return replace(PRESET, uncertainty=replace(PRESET.uncertainty, **changes))


@pytest.mark.parametrize("kind", DisturbanceKind)
@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    surface=st.floats(0, 1e-2),
    rate=st.floats(0, 1.0),
    soc=st.floats(0, 1e-5),
)
def test_bounds_and_slope_hold(kind, seed, surface, rate, soc):
    preset = with_uncertainty(surface_K_per_s=surface, surface_rate_K_per_s2=rate, soc_per_s=soc)
    values = knots(kind, preset, seed, 2_000)
    assert np.all(np.abs(values) <= bounds(preset) * (1 + 1e-12))
    slope = np.diff(values[:, 2], prepend=0.0) / STEP_S
    assert np.abs(slope).max() <= rate * (1 + 1e-9) + 1e-15


def test_none_is_zero():
    assert not knots(DisturbanceKind.NONE).any()


def test_upward_is_at_the_upper_bound_once_the_slope_allows():
    assert np.allclose(knots(DisturbanceKind.UPWARD)[1:], bounds(PRESET), rtol=1e-12)


def test_bang_bang_is_always_at_a_bound_and_visits_both():
    values = knots(DisturbanceKind.BANG_BANG, count=200_000)
    for column, bound in zip(values.T[1:], bounds(PRESET)[1:]):
        at_bound = np.isclose(np.abs(column), bound, rtol=1e-9)
        assert at_bound.mean() > 0.99  # the rest are steps of the surface ramp
        assert 0.02 < (column > 0).mean() < 0.98


def test_bang_bang_dwells_between_one_step_and_many():
    core = knots(DisturbanceKind.BANG_BANG, count=500_000)[:, 1]
    dwell = np.diff(np.flatnonzero(np.diff(core) != 0))
    assert dwell.min() == 1
    assert dwell.max() * STEP_S > 10.0


def test_bang_bang_rates_switch_independently():
    signs = np.sign(knots(DisturbanceKind.BANG_BANG, count=500_000)[:, 1:])
    assert len(np.unique(signs, axis=0)) >= 8


def test_gaussian_has_the_statistics_of_a_clipped_normal():
    values = knots(DisturbanceKind.GAUSSIAN, count=50_000)[:, 1] / PRESET.uncertainty.core_K_per_s
    # Standard normal cut at one sigma: 2 (1 - Phi(1)) of the draws lie on the bound.
    assert np.mean(np.abs(values) == 1.0) == pytest.approx(0.3173, abs=0.01)
    assert values.mean() == pytest.approx(0.0, abs=0.02)
    assert values.var() == pytest.approx(0.5161, abs=0.02)


@pytest.mark.parametrize("kind", [DisturbanceKind.GAUSSIAN, DisturbanceKind.BANG_BANG])
def test_the_seed_decides(kind):
    assert np.array_equal(knots(kind, seed=1), knots(kind, seed=1))
    assert not np.array_equal(knots(kind, seed=1), knots(kind, seed=2))
