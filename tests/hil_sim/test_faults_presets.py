"""The fault matrix with other presets: rows follow them, or say why they do not apply."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import pytest

from bms.calibration.plausibility import plausibility_fields
from bms.model.pair import load_pair
from hil_sim.fault_matrix.place import nominal_initial, nominal_onset
from hil_sim.fault_matrix.report import MatrixResult, matrix_json, matrix_junit, matrix_page
from hil_sim.fault_matrix.runner import MatrixSettings, place_of, play
from hil_sim.fault_matrix.size import sized
from tests.hil_sim.test_faults_matrix import ROWS, SETTINGS, is_quick, named


def of_preset(name, **limits):
    """Settings of a preset with other limits; its model states the error that it had before."""
    preset, model = load_pair(name, None)
    preset = replace(preset, limits=replace(preset.limits, **limits))
    return MatrixSettings(preset, replace(model, training_hash=preset.training_hash))


LIN2014 = of_preset("lin2014")
COOL = of_preset("lin2014", max_core_temperature_K=313.0, max_surface_temperature_K=312.0)
WEAK = of_preset("lin2014", reference_current_A=-6.0)
FAMILY = of_preset("a123_26650")
SMALL = MatrixSettings(*load_pair("samsung_30q", None))
SAMPLE = (
    "lost for good: CellThermal",
    "surface sensor biased cold",
    "surface sensor biased warm",
    "surface jumps far above the core",
    "current sensor sticks",
    "charger supplies more than commanded",
    "sensor wire broken: voltage_V",
)


@pytest.mark.parametrize("settings", [LIN2014, COOL], ids=["lin2014", "other limits"])
@pytest.mark.parametrize("name", SAMPLE)
def test_row_follows_another_preset(settings, name):
    verdict = play(settings, named(name))
    assert (verdict.failures, verdict.does_not_apply) == ((), None)


@pytest.mark.parametrize(
    ("settings", "reasons"),
    [
        (
            WEAK,
            {
                "charger supplies more than commanded": "3.0 A flow, of which 20% are no clear",
                "surface sensor biased warm": "no temperature limits",
            },
        ),
        (
            FAMILY,
            {
                "surface sensor biased cold": "a family of cells",
                "surface sensor biased warm": "no temperature limits",
                "surface jumps far above the core": "a family of cells",
                "current sensor sticks": "a family of cells",
                "charger supplies more than commanded": "a family of cells",
            },
        ),
    ],
    ids=["weak current", "family"],
)
def test_row_that_does_not_apply_to_a_preset_says_why(settings, reasons):
    verdicts = [play(settings, named(name)) for name in SAMPLE]
    said = {v.row.name: v.does_not_apply for v in verdicts if v.does_not_apply}
    assert [v.failures for v in verdicts] == [()] * len(SAMPLE)
    assert set(said) == set(reasons)
    assert all(reason in said[name] for name, reason in reasons.items())


def test_only_a_need_that_the_row_names_excuses_it():
    """Otherwise the same outcome is red."""
    row = replace(named("surface sensor biased warm"), needs=())
    verdict = play(WEAK, row)
    assert verdict.does_not_apply is None
    assert verdict.failures[0].endswith("no less than before")


def test_default_preset_meets_every_need():
    """There is nothing to excuse where deadlines and sizes come from."""
    chosen = [row for row in ROWS if row.needs and is_quick(row)]
    assert len(chosen) >= 8
    assert [play(SETTINGS, row).does_not_apply for row in chosen] == [None] * len(chosen)


@pytest.mark.parametrize(
    ("start", "temperature_K", "onset"),
    [("warm", 303.0, 90), ("growing", 300.0, 23)],
)
def test_start_follows_the_preset(start, temperature_K, onset):
    row = named({"warm": "surface sensor biased cold", "growing": "current sensor sticks"}[start])
    assert nominal_initial(COOL.preset, row.start).temperature_K == temperature_K
    assert nominal_onset(COOL.preset, row.start) == onset
    # Half of 6 A, growing by 0.5 A a period.
    assert nominal_onset(WEAK.preset, row.start) == {"warm": 90, "growing": 6}[start]
    found = place_of(COOL, row.start)
    assert (found.initial.temperature_K, found.onset) == (temperature_K, onset)


def test_a_row_begins_where_and_when_its_charge_has_a_current():
    """A kelvin below its limit this family gives none, and its core is unknown at first."""
    near = replace(named("surface sensor sticks").start, below_limit_K=1.0)
    found = place_of(SMALL, near)
    limit_K = SMALL.preset.limits.max_surface_temperature_K
    assert found.initial.temperature_K == pytest.approx(limit_K - 4.0)
    assert found.onset == near.onset_period
    growing = named("current sensor sticks").start
    assert place_of(SMALL, growing).onset > nominal_onset(SMALL.preset, growing)
    assert play(SMALL, named("sensor sticks: cooling_power_W")).failures == ()


@pytest.mark.parametrize(
    "name",
    [
        "current sensor biased a little: offset -0.5",
        "unit swapped: current_A",
        "voltage sensor drifts: rate_per_s 0.01",
    ],
)
def test_figures_of_a_fault_follow_the_preset(name):
    """Of 4 A, half of the permitted deviation is not half an ampere."""
    verdict = play(SMALL, named(name))
    assert (verdict.failures, verdict.does_not_apply) == ((), None)


def test_figures_are_in_what_the_preset_permits():
    row = named("current sensor biased a little: offset -0.5")
    permitted_A = plausibility_fields(SMALL.preset)["current_deviation_A"]
    assert 0.0 < permitted_A < 0.5
    assert sized(row.fault, row.size, SMALL.preset).offset == pytest.approx(-0.5 * permitted_A)
    assert sized(row.fault, row.size, SETTINGS.preset) == row.fault


def test_what_does_not_apply_stands_in_every_report():
    verdict = play(WEAK, named("surface sensor biased warm"))
    result = MatrixResult(WEAK, [verdict, play(WEAK, named("lost for good: Coolant"))], 1.0)
    assert result.sentence == (
        "all 1 rows as expected, 1 do not apply, no limit of the plant crossed"
    )
    assert matrix_json(result)["results"][-1]["does_not_apply"] == verdict.does_not_apply
    assert verdict.does_not_apply in matrix_page(result)
    suite = ElementTree.fromstring(matrix_junit(result))[0]
    assert suite.get("skipped") == "1"
    (skipped,) = suite.iter("skipped")
    assert skipped.get("message") == verdict.does_not_apply
