"""No cell of a drawn pack crosses a limit; with less seen, or less in reserve, some do."""

from dataclasses import replace

import numpy as np
import pytest

from bms.cell import CellState, Disturbance, scaled
from bms.errors import InputError
from bms.model.pair import load_pair
from hil_sim.run.workforce import InlineExecutor, Workforce
from hil_sim.studies.pack.engine import Core, PackCharge, View, peak_limits, play
from hil_sim.studies.pack.prediction import core_differences, surface_differences
from hil_sim.studies.pack.reserves import Reserves, reserves
from hil_sim.studies.pack.settings import PackSettings
from hil_sim.studies.pack.spread import PackDraw, Spread, Surroundings
from hil_sim.studies.pack.study import (
    MEAN,
    ONE_CELL,
    WEAKEST,
    WITHOUT_RESERVES,
    group_name,
    run_packs,
    run_study,
)
from hil_sim.studies.pack.summary import claim_holds, summarise

PRESET, MODEL = load_pair("paper_calibrated", None)
SETTINGS = PackSettings(PRESET, MODEL, cells=16, packs=4)
NAMES = (WEAKEST, *map(group_name, (2, 4, 8)), WITHOUT_RESERVES, ONE_CELL, MEAN)


@pytest.fixture(scope="module")
def rows():
    return run_packs(SETTINGS, range(4))


def test_no_cell_crosses_a_limit_where_each_has_its_own_interval(rows):
    summary = summarise(SETTINGS, rows)
    assert tuple(summary["controllers"]) == NAMES
    assert claim_holds(summary)
    for name in NAMES[:4]:
        figures = summary["controllers"][name]
        assert (figures["cells_over"], figures["packs_full"]) == (0, 4), name
        assert max(figures["worst"].values()) < 0.0, name
    assert summary["controllers"][WEAKEST]["over_slowest_alone"]["most"] <= 1.03


@pytest.mark.parametrize("name", [ONE_CELL, MEAN, WITHOUT_RESERVES])
def test_what_sees_less_or_has_no_reserve_lets_cells_cross_limits(rows, name):
    figures = summarise(SETTINGS, rows)["controllers"][name]
    assert figures["packs_over"] >= 3
    if name != WITHOUT_RESERVES:
        assert figures["worst"]["core_K"] > 0.3


def test_the_claim_does_not_hold_where_a_pack_is_over_or_not_full(rows):
    for change in ({"cells_over": 1}, {"outcome": "fault"}):
        changed = [dict(row, controllers=dict(row["controllers"])) for row in rows]
        ours = changed[2]["controllers"]
        ours[group_name(4)] = ours[group_name(4)] | change
        assert not claim_holds(summarise(SETTINGS, changed))


def test_the_coupling_is_beyond_the_presets_bound_and_within_the_reserve(rows):
    coupling = summarise(SETTINGS, rows)["coupling"]
    assert not coupling["preset_covers_surface"]
    assert coupling["reserve_covers_surface"]
    assert coupling["preset_surface_K_per_s"] < coupling["surface_K_per_s"]
    apart = replace(SETTINGS, around=Surroundings(neighbour_W_per_K=0.0))
    alone = summarise(apart, run_packs(apart, [0]))["coupling"]
    assert alone["surface_K_per_s"] == 0.0
    assert alone["preset_covers_surface"]


def test_a_pack_depends_on_seed_and_number_only():
    few = replace(SETTINGS, cells=2, packs=6, max_time_s=10.0)
    rows = run_packs(few, range(6))
    done = []
    assert run_study(few, Workforce(InlineExecutor(), 2), done.append) == rows
    assert sum(done) == 6
    assert run_packs(few, [4]) == [rows[4]]
    assert run_packs(replace(few, seed=1), [4]) != [rows[4]]


def hot_cell_pack():
    """Four cells of the spread's worst corner and its best: the third is the one that heats."""
    spread = Spread()
    ends = [(0, 0), (0, 0), (1, 1), (0, 0)]
    factors = [
        replace(
            spread.factors(np.random.default_rng(0)),
            core_resistance=spread.core_resistance[rc],
            resistance=spread.resistance[r],
            capacity=1.0,
        )
        for rc, r in ends
    ]
    state = CellState(PRESET.initial.soc, *[PRESET.initial.temperature_K] * 3)
    return PackDraw(
        tuple(scaled(PRESET.cell, f) for f in factors), (state,) * 4, (Disturbance(),) * 4
    )


@pytest.mark.parametrize(("cells", "crosses"), [((0, 1, 2, 3), False), ((0, 1, 3), True)])
def test_the_claim_breaks_when_the_governing_cell_is_left_out_of_the_intersection(cells, crosses):
    core = Core(PRESET, MODEL, reserves(PRESET, Spread(), Surroundings()))
    view = View(cells, tuple(range(len(cells))))
    charge = PackCharge(core, hot_cell_pack(), Surroundings(), view, 3600.0)
    play([charge], 4, np.random.default_rng(5))
    over = charge.peaks() - peak_limits(PRESET)
    assert charge.outcome == "complete"
    assert (over[2] > 0.0).any() == crosses
    assert not (over[[0, 1, 3]] > 0.0).any()


def worst_corner_gap_K(bare_changes):
    """Greatest excess of a cell without thermistor over its bound, at the spread's corners."""
    spread, around = Spread(), Surroundings(neighbour_W_per_K=0.0)
    kept = reserves(PRESET, spread, around)
    core = Core(PRESET, MODEL, Reserves(kept.changes, kept.bare | bare_changes, kept.deficit_K))
    nominal = PRESET.cell
    state = CellState(PRESET.initial.soc, *[PRESET.initial.temperature_K] * 3)
    worst_K = -np.inf
    for corner in spread.corners(nominal):
        hot = replace(
            corner, ohmic_resistance_ohm=spread.resistance[1] * nominal.ohmic_resistance_ohm
        )
        draw = PackDraw((nominal, hot), (state, state), (Disturbance(),) * 2)
        charge = PackCharge(core, draw, around, View((0, 1), (0,)), 3600.0)
        rng = np.random.default_rng(1)
        while not charge.is_over:
            charge.advance(rng.standard_normal((10, 8)))
            bound_K = charge.fields.pack.cell[1].surface_temperature_K
            # The plant is a period ahead of the bound.
            true_K = charge.fields.plant.cell[1].memory.state.surface - 0.1
            worst_K = max(worst_K, true_K - bound_K)
    return worst_K


def test_a_cell_without_a_thermistor_is_never_above_its_bound():
    assert worst_corner_gap_K({}) < 0.0


def test_without_its_reserves_the_bound_of_a_cell_without_a_thermistor_is_broken():
    nothing = {
        "surface_K": 0.0,
        "surface_K_per_W": 0.0,
        "estimate_K": 0.0,
        "resistance_factor": 1.0,
    }
    assert worst_corner_gap_K(nothing) > 0.3


def test_cells_within_the_spread_differ_less_from_the_prediction_than_its_corners():
    spread = Spread()
    rng = np.random.default_rng(4)
    for of in (surface_differences, core_differences):
        corners = of(PRESET, spread)
        for _ in range(4):
            f = spread.factors(rng)
            ends = (f.core_resistance, f.core_heat_capacity, f.surface_resistance)
            inside = Spread(*((end, end) for end in ends))
            one = of(PRESET, inside)
            assert one.above_K_per_W <= corners.above_K_per_W
            assert one.below_K_per_W <= corners.below_K_per_W
            assert one.falling_K_per_K_per_s <= corners.falling_K_per_K_per_s


def test_a_familys_pack_keeps_the_limits_that_one_cell_alone_lets_others_cross():
    preset, model = load_pair("a123_26650_10C", None)
    settings = PackSettings(preset, model, cells=4, packs=1, max_time_s=4000.0)
    summary = summarise(settings, run_packs(settings, [1]))
    assert claim_holds(summary)
    assert set(summary["controllers"]) == {WEAKEST, ONE_CELL, MEAN}
    assert summary["controllers"][ONE_CELL]["cells_over"] > 0


def test_gains_at_which_the_cores_condition_is_not_invariant_are_refused():
    with pytest.raises(InputError, match=r"lin2014.*alpha2_per_s is not 1/\(Rc Cc\)"):
        reserves(load_pair("lin2014", None)[0], Spread(), Surroundings())
