"""Draws have the distributions that are stated, and depend on seed and run number only."""

import numpy as np
import pytest
from scipy.stats import kstest, pearsonr

from bms.presets import load_preset
from hil_sim.plant.disturbances import DisturbanceKind, knot_bounds
from hil_sim.studies.campaign.draws import Family, draw
from hil_sim.studies.campaign.engine import limit_slope
from hil_sim.studies.campaign.noise import knot_blocks, streams

RUNS = 2000
STEP_S = 0.01


def draws_of(preset, seed=11):
    return [draw(preset, run, streams(seed, run).draw) for run in range(RUNS)]


def of_family(draws, family):
    return [one for one in draws if one.family is family]


def is_uniform(values, low, high):
    assert low <= min(values) and max(values) <= high
    return kstest((np.array(values) - low) / (high - low), "uniform").pvalue > 1e-3


def test_published_cells_are_uniform_in_the_intervals_of_lin_2014():
    cells = [one.cell for one in of_family(draws_of(load_preset("lin2014")), Family.PUBLISHED)]
    assert is_uniform([cell.core_resistance_K_per_W for cell in cells], 1.86, 2.01)
    assert is_uniform([cell.core_heat_capacity_J_per_K for cell in cells], 59.1, 66.4)
    assert is_uniform([cell.surface_resistance_K_per_W for cell in cells], 3.19, 3.20)


def test_other_presets_have_the_same_relative_intervals():
    preset = load_preset("paper_calibrated")
    ours = of_family(draws_of(preset), Family.PUBLISHED)
    lins = of_family(draws_of(load_preset("lin2014")), Family.PUBLISHED)
    nominal = preset.cell
    for our, lin in zip(ours, lins):
        assert our.cell.core_resistance_K_per_W / nominal.core_resistance_K_per_W == (
            pytest.approx(lin.cell.core_resistance_K_per_W / 1.94)
        )
        assert our.cell.surface_heat_capacity_J_per_K == nominal.surface_heat_capacity_J_per_K
        assert our.cell.ocv == nominal.ocv


def test_states_and_cooling_are_uniform_and_independent(any_preset):
    draws = draws_of(any_preset)
    soc = [one.soc for one in draws]
    cooling_W = [one.cooling_power_W for one in draws]
    temperature_K = [one.temperature_K for one in draws]
    assert is_uniform(soc, 0.0, 0.5)
    assert is_uniform(cooling_W, *any_preset.operating_box.cooling_power_W)
    assert max(temperature_K) < any_preset.limits.max_core_temperature_K
    assert min(temperature_K) > any_preset.operating_box.surface_temperature_K[0]
    assert pearsonr(soc, cooling_W).pvalue > 1e-3
    assert pearsonr(soc, temperature_K).pvalue > 1e-3
    kinds = [one.disturbance for one in draws]
    assert {kinds.count(kind) > RUNS // 4 for kind in set(kinds)} == {True}
    assert DisturbanceKind.NONE not in kinds


def test_cells_within_share_the_bounds_with_the_disturbance(any_preset):
    families = [one.family for one in draws_of(any_preset)]
    assert families == [Family.WITHIN, Family.PUBLISHED] * (RUNS // 2)
    within = of_family(draws_of(any_preset), Family.WITHIN)
    assert is_uniform([one.disturbance_share for one in within], 0.0, 1.0)
    nominal_K_per_W = any_preset.cell.core_resistance_K_per_W
    deviations = [abs(one.cell.core_resistance_K_per_W / nominal_K_per_W - 1) for one in within]
    assert 0.0 < max(deviations) < 0.01


def test_a_run_is_the_same_whatever_ran_before():
    preset = load_preset("lin2014")
    alone = draw(preset, 7, streams(11, 7).draw)
    assert alone == draws_of(preset)[7]
    assert alone != draw(preset, 7, streams(12, 7).draw)


@pytest.mark.parametrize(
    "kind", [DisturbanceKind.GAUSSIAN, DisturbanceKind.BANG_BANG, DisturbanceKind.UPWARD]
)
def test_disturbances_use_their_share_of_the_bounds_and_no_more(kind, any_preset):
    bounds, share = any_preset.uncertainty, 0.25
    blocks = knot_blocks(
        kind, knot_bounds(any_preset), share, STEP_S, 600.0, np.random.default_rng(2)
    )
    knots = np.concatenate([blocks(1000) for _ in range(60)])
    largest = np.abs(knots).max(axis=0)
    expected = [bounds.soc_per_s, bounds.core_K_per_s, bounds.surface_K_per_s]
    assert largest[:3] == pytest.approx(share * np.array(expected))
    assert largest[3] == pytest.approx(share * bounds.coolant_K_per_s)
    if kind is DisturbanceKind.BANG_BANG:
        flips = np.count_nonzero(np.diff(knots[:, 1]))
        assert 20 < flips < 200


def test_blocks_of_bang_bang_join_without_a_seam(any_preset):
    def source():
        return knot_blocks(
            DisturbanceKind.BANG_BANG,
            knot_bounds(any_preset),
            1.0,
            STEP_S,
            60.0,
            np.random.default_rng(2),
        )

    whole, pieces = source(), source()
    assert np.array_equal(whole(3000), np.concatenate([pieces(n) for n in (1, 999, 2000)]))


def test_the_slope_of_the_surface_disturbance_is_limited():
    knots = np.zeros((6, 4))
    knots[:, 2] = [1.0, 1.0, 1.0, -1.0, 0.1, 0.1]
    limit_slope(knots, 0.0, 0.4)
    assert knots[:, 2] == pytest.approx([0.4, 0.8, 1.0, 0.6, 0.2, 0.1])
    assert not knots[:, [0, 1, 3]].any()
