"""Gains that are searched for: certified, no slower, the same each time; and a gap that adds up."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from bms.errors import InputError
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset, one_cell_preset_names
from bms.presets.paper_form import in_paper_form
from bms.verification.verify import verify
from hil_sim.studies.tuning.charges import Outcome, outcomes, tuning_starts
from hil_sim.studies.tuning.search import (
    Choice,
    Tuned,
    most_growth_A_per_s,
    tune,
    with_choice,
)
from tests.hil_sim.command_line import bms


def played(preset):
    return Tuned(
        preset, tuple(outcomes(preset, load_shipped_model(preset.name), tuning_starts(preset)))
    )


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_the_shipped_gains_are_faster_than_the_papers_and_keep_every_limit(name):
    preset = load_preset(name)
    ours, the_papers = played(preset), played(in_paper_form(preset))

    assert all(one.is_good for one in (*ours.outcomes, *the_papers.outcomes))
    assert ours.mean_s < 0.95 * the_papers.mean_s


@pytest.mark.slow
def test_a_search_from_the_papers_gains_finds_the_shipped_ones():
    preset = load_preset("lin2014")
    found = tune(in_paper_form(preset), load_shipped_model("lin2014"))

    assert found.preset.gains == preset.gains
    assert found.preset.limits == preset.limits
    assert verify(found.preset, load_shipped_model("lin2014"), samples=2000).certified


@pytest.mark.parametrize(
    "room", [(0.0, 0.0, 0.0, 0.0), *(tuple(-1e-9 * (i == j) for j in range(4)) for i in range(4))]
)
def test_a_crossed_limit_or_an_unfilled_cell_does_not_count(room):
    good = min(room) >= 0.0
    assert Outcome(100.0, room).is_good == good
    assert not Outcome(math.inf, room).is_good
    mean_s = Tuned(
        load_preset("lin2014"), (Outcome(100.0, room), Outcome(400.0, (1.0,) * 4))
    ).mean_s
    assert mean_s == pytest.approx(200.0 if good else math.inf)


def test_a_choice_says_what_its_gains_do():
    preset = load_preset("lin2014")
    cell = preset.cell
    a1_per_s = 1.0 / (cell.core_resistance_K_per_W * cell.core_heat_capacity_J_per_K)
    own = replace(preset, name="own")
    gains = with_choice(own, Choice(0.1, 2.0, 1.0, 0.25, 1.0)).gains

    assert gains.alpha2_per_s == pytest.approx(2.0 * a1_per_s, rel=5e-3)
    larger, smaller = gains.surface_roots_per_s
    assert smaller / (larger + smaller) == pytest.approx(0.25, abs=2e-3)
    assert with_choice(own, Choice(0.1, 1.0, 1.0, 0.25, 1.0)).gains.alpha2_per_s is None
    assert most_growth_A_per_s(preset) == 5.0


def test_a_family_is_not_tuned():
    preset = load_preset("a123_26650_10C")
    with pytest.raises(InputError, match="tune a preset of one cell"):
        tune(preset, load_shipped_model(preset.name))


@pytest.mark.slow
def test_the_parts_of_the_gap_add_up_to_the_time():
    pytest.importorskip("cvxpy")
    result = bms("tune", "--preset", "lin2014", "--gap", "--json")

    rows = json.loads(result.stdout)
    assert len(rows) == 12
    for row in rows:
        assert row["bound_s"] + math.fsum(row["parts_s"]) == pytest.approx(row["time_s"])
        assert 1.0 < row["time_s"] / row["bound_s"] < 1.06
