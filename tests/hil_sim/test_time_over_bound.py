"""The time to full beside the bounds that no controller can beat, in summary, table and report."""

import json
from dataclasses import replace

import pytest

from bms.presets import load_preset
from bms.presets.optimum import known_bound
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.run.settings import Settings
from hil_sim.run.summary import bound_of
from tests.hil_sim.command_line import bms

PRESET = load_preset("lin2014")


@pytest.mark.slow
def test_a_whole_charge_has_its_time_over_both_bounds_everywhere(tmp_path):
    done = bms("sil", "--preset", PRESET.name, "--out", tmp_path / "run")
    assert done.returncode == 0
    known = known_bound(PRESET)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["optimum_time_s"] == known.optimum_time_s
    assert summary["lower_bound_s"] == known.lower_bound_s
    over_optimum = summary["charge_time_s"] / known.optimum_time_s
    over_bound = summary["charge_time_s"] / known.lower_bound_s
    assert summary["time_over_optimum"] == pytest.approx(over_optimum, abs=5e-5)
    assert summary["time_over_bound"] == pytest.approx(over_bound, abs=5e-5)
    assert 1.0 < over_bound < over_optimum
    page = (tmp_path / "run" / "report.html").read_text()
    for text in (done.stdout, page):
        assert "over the bound of physics" in text
        assert "over the bound with ramp and map" in text
        assert f"{over_bound:.3f}" in text
        assert f"{known.lower_bound_s:.1f} s" in text


def test_a_charge_that_does_not_end_has_bounds_and_no_ratio():
    done = bms("sil", "--preset", PRESET.name, "--max-time-s", 5, "--json")
    summary = json.loads(done.stdout)
    assert summary["lower_bound_s"] == known_bound(PRESET).lower_bound_s
    assert (summary["time_over_optimum"], summary["time_over_bound"]) == (None, None)


def test_a_bound_is_not_told_of_another_cell_start_plant_or_disturbance():
    settings = Settings(PRESET)
    assert bound_of(settings) == known_bound(PRESET)
    assert bound_of(replace(settings, initial=PRESET.initial)) == known_bound(PRESET)
    others = [
        replace(settings, true_cell=nominal_cell(PRESET)),
        replace(settings, initial=replace(PRESET.initial, soc=0.2)),
        replace(settings, plant="pybamm"),
        replace(settings, disturbance=DisturbanceKind.BANG_BANG),
        replace(settings, preset=replace(PRESET, initial=replace(PRESET.initial, soc=0.2))),
    ]
    assert [bound_of(other) for other in others] == [None] * len(others)
