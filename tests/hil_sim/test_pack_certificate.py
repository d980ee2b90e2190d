"""`bms verify --cells`: what it certifies of a pack, and that what a pack lacks turns it red."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hil_sim.studies.pack.certificate as certificate_module
from bms.cell import CellFactors, scaled
from bms.errors import InputError
from bms.model.pair import load_pair
from bms.verification.conditions import firmware_constants, required_conditions
from bms.verification.family import verify_family
from hil_sim.commands import pack_certificate as command
from hil_sim.commands.verify import verify
from hil_sim.pack.settings import NO_SPREAD
from hil_sim.studies.pack.cell_certificates import (
    CellCase,
    certify_core,
    spread_ends,
    warmest_coolant_K,
    worst_cell,
)
from hil_sim.studies.pack.certificate import certify_pack
from hil_sim.studies.pack.coupling import (
    coupling_K_per_s,
    greatest_heat_W,
    neighbour_gap_K,
)
from hil_sim.studies.pack.engine import all_cells
from hil_sim.studies.pack.reserves import ESTIMATE_ERROR_K, Reserves, reserves
from hil_sim.studies.pack.spread import Spread, Surroundings
from tests.hil_sim.command_line import bms

PRESET, MODEL = load_pair("paper_calibrated", None)
SPREAD, AROUND = Spread(), Surroundings()
BOUND_K_per_s = coupling_K_per_s(PRESET, SPREAD, AROUND)


@cache
def shown(per_thermistor=1):
    return certify_pack(PRESET, MODEL, SPREAD, AROUND, all_cells(4, per_thermistor))


def broken(**changes):
    """The certificate with constants of the pack set to others."""
    kept = reserves(PRESET, SPREAD, AROUND)
    changed = Reserves(kept.changes | changes, kept.bare, kept.deficit_K)
    return certify_pack(PRESET, MODEL, SPREAD, AROUND, all_cells(2), changed)


def claim(certificate, name):
    return next(one for one in certificate.claims if one.name == name)


def test_a_pack_of_the_ordinary_spread_is_certified_with_its_margins():
    certificate = shown()
    assert certificate.certified
    assert [one.name for one in certificate.claims] == [
        "voltage", "state of charge", "count", "core", "surface", "neighbours", "coupling seen",
        "limits seen",
    ]  # fmt: skip
    assert certificate.cells_checked == 32 + 8
    assert 0.0 < claim(certificate, "voltage").margin < 2e-3
    assert all(one.reason == "" for one in certificate.claims)


def test_the_cores_margin_consists_of_sampling_neighbours_and_estimate_and_covers_the_coupling():
    part = shown().core_margin
    parts = (part["sampling_K_per_s"], part["neighbours_K_per_s"], part["estimate_K_per_s"])
    assert sum(parts) == pytest.approx(part["whole_K_per_s"])
    assert min(parts) > 0.0
    assert part["coupling_bound_K_per_s"] == pytest.approx(BOUND_K_per_s)
    assert part["coupling_covered_K_per_s"] >= BOUND_K_per_s
    # It is no accident: the margin does not last for much more.
    assert part["coupling_covered_K_per_s"] < 1.2 * BOUND_K_per_s
    assert part["preset_surface_K_per_s"] < 0.01 * BOUND_K_per_s


def without_coupling():
    kept, hold_s = reserves(PRESET, SPREAD, AROUND).changes, 0.2
    return kept["core_margin_K_per_s"] - kept["a1_per_s"] * hold_s * BOUND_K_per_s


def without_estimate():
    kept = reserves(PRESET, SPREAD, AROUND).changes
    return kept["core_margin_K_per_s"] - abs(kept["a2_per_As"]) * 23.0 * ESTIMATE_ERROR_K


SMALLEST_OHM = SPREAD.resistance[0] * PRESET.cell.ohmic_resistance_ohm
GREATEST_CC = SPREAD.core_heat_capacity[1] * PRESET.cell.core_heat_capacity_J_per_K


@pytest.mark.parametrize(
    ("changes", "red"),
    [
        ({"core_margin_K_per_s": without_coupling()}, ["core"]),
        ({"core_margin_K_per_s": without_estimate()}, ["core"]),
        ({"a3_K_per_A2s": SMALLEST_OHM / GREATEST_CC}, ["core"]),
        ({"a1_per_s": 0.0246, "alpha2_per_s": 0.0246}, ["core"]),
        ({"ohmic_resistance_ohm": SMALLEST_OHM}, ["voltage"]),
        ({"voltage_margin_V": 0.003}, ["voltage"]),
        ({"completion_soc": 1.0, "soc_margin_per_s": 1e-5}, ["voltage", "state of charge"]),
        ({"capacity_As": SPREAD.capacity[1] * PRESET.cell.capacity_As}, ["count"]),
    ],
)
def test_a_reserve_that_is_left_out_turns_its_claim_red(changes, red):
    certificate = broken(**changes)
    assert not certificate.certified
    assert [one.name for one in certificate.claims[:5] if not one.holds] == red
    assert claim(certificate, red[0]).reason.startswith(
        "counted by" if red == ["count"] else "the cell with Rc times "
    )
    assert certificate.as_dict()["certified"] is False


def test_the_core_of_a_hot_cell_is_not_certified_by_the_constants_of_the_nominal_one():
    cells = [scaled(PRESET.cell, factors) for factors in spread_ends(SPREAD)]
    worst = worst_cell(PRESET.cell, SPREAD)
    constants = firmware_constants(PRESET, MODEL)
    cases = [CellCase(PRESET, cell, worst, constants, 0.0, 0.0) for cell in cells]
    results = {certify_core(case, 20_000).holds for case in cases}
    assert results == {True, False}


def test_a_condition_in_another_unit_is_the_same_condition():
    condition = required_conditions(PRESET)[0]
    state = (310.0, 305.0, 300.0, -12.0, 0.5)
    assert condition.times(0.7).value(*state) == pytest.approx(0.7 * condition.value(*state))
    assert condition.times(0.7).limit_K == condition.limit_K


def two_neighbours(current_of, hot, cold, k):
    """Surfaces of two cells side by side, whose coolant is one mass, solved by scipy."""

    def slopes(time_s, state):
        cores, surfaces, coolant = state[:2], state[2:4], state[4]
        heat = [cell.ohmic_resistance_ohm * current_of(time_s) ** 2 for cell in (hot, cold)]
        up = [
            (core - surface) / cell.core_resistance_K_per_W
            for core, surface, cell in zip(cores, surfaces, (hot, cold))
        ]
        out = [
            (surface - coolant) / cell.surface_resistance_K_per_W
            for surface, cell in zip(surfaces, (hot, cold))
        ]
        over = k * (surfaces[0] - surfaces[1])
        cs = PRESET.cell.surface_heat_capacity_J_per_K
        return [
            (heat[0] - up[0]) / hot.core_heat_capacity_J_per_K,
            (heat[1] - up[1]) / cold.core_heat_capacity_J_per_K,
            (up[0] - out[0] - over) / cs,
            (up[1] - out[1] + over) / cs,
            sum(out) / (2.0 * PRESET.cell.coolant_heat_capacity_J_per_K),
        ]

    return solve_ivp(slopes, (0.0, 900.0), [300.0] * 5, max_step=1.0)


def test_no_history_of_current_sets_two_neighbours_further_apart_than_the_bound():
    """The currents are those that the slower response of one cell makes most of."""
    rng = np.random.default_rng(2)
    most_K = {}
    for k in (0.0, 0.02):
        bound_K = neighbour_gap_K(PRESET, SPREAD, Surroundings(k))
        gaps = []
        for _ in range(6):
            hot, cold = (
                scaled(
                    PRESET.cell,
                    CellFactors(
                        core_resistance=SPREAD.core_resistance[int(rng.integers(2))],
                        core_heat_capacity=SPREAD.core_heat_capacity[end],
                        surface_resistance=SPREAD.surface_resistance[1 - end],
                        resistance=SPREAD.resistance[1 - end],
                    ),
                )
                for end in (0, 1)
            )
            off_s, on_s = np.sort(rng.uniform(0.0, 900.0, 2))
            run = two_neighbours(lambda t: 0.0 if off_s < t < on_s else 23.0, hot, cold, k)  # noqa: B023
            gaps.append(np.abs(run.y[2] - run.y[3]).max())
        most_K[k] = max(gaps)
        assert most_K[k] < bound_K
    # What is at rest alone would not do: it is passed on the way there.
    heat_W = greatest_heat_W(PRESET, SPREAD)
    assert most_K[0.0] > 0.5 * heat_W * PRESET.cell.surface_resistance_K_per_W * 0.1


def test_more_conduction_or_more_spread_needs_a_greater_bound():
    wider = replace(SPREAD, resistance=(0.9, 1.1))
    assert coupling_K_per_s(PRESET, wider, AROUND) > BOUND_K_per_s
    assert coupling_K_per_s(PRESET, SPREAD, Surroundings(0.05)) > 2.5 * BOUND_K_per_s
    assert coupling_K_per_s(PRESET, SPREAD, Surroundings(0.0)) == 0.0
    assert neighbour_gap_K(PRESET, NO_SPREAD, AROUND) < 0.2 * neighbour_gap_K(
        PRESET, SPREAD, AROUND
    )


def test_packs_that_are_charged_stay_within_the_bound_of_the_coupling():
    trials = shown().trials
    assert (trials.packs, trials.cells_over, trials.not_full) == (3, 0, 0)
    # Hot cells beside cold ones show a good part of it.
    assert 0.3 * BOUND_K_per_s < trials.coupling_K_per_s < BOUND_K_per_s


def test_a_coupling_beyond_the_bound_turns_what_is_seen_red():
    """The constants are of a pack with less conduction than the one that is charged."""
    kept = reserves(PRESET, SPREAD, Surroundings(0.002))
    certificate = certify_pack(PRESET, MODEL, SPREAD, AROUND, all_cells(2), kept)
    assert [one.name for one in certificate.claims if not one.holds] == ["core"]


def test_no_surface_passes_its_limit_in_a_coolant_just_below_the_warmest_that_is_certified():
    """Core at its limit, disturbance at its bound, no neighbour that cools."""
    limit_K, nu = PRESET.limits.max_surface_temperature_K, PRESET.uncertainty.surface_K_per_s
    for factors in spread_ends(SPREAD):
        cell = scaled(PRESET.cell, factors)
        for beyond_K, rises in ((-1e-6, False), (1e-4, True)):
            coolant_K = warmest_coolant_K(PRESET, cell) + beyond_K
            slope = nu - (limit_K - coolant_K) / (
                cell.surface_resistance_K_per_W * cell.surface_heat_capacity_J_per_K
            )
            assert (slope > 0.0) == rises


def test_a_pack_with_fewer_thermistors_names_what_its_bound_rests_on():
    certificate = shown(2)
    assert certificate.certified
    assert claim(certificate, "no thermistor").margin > 0.0
    assert certificate.thermistors == 2
    assert any("without thermistor" in text for text in certificate.not_proven)
    assert not any("without thermistor" in text for text in shown().not_proven)


def test_without_its_reserve_a_surface_without_thermistor_is_above_its_bound():
    kept = reserves(PRESET, SPREAD, AROUND)
    nothing = kept.bare | {
        "surface_K": 0.0, "surface_K_per_W": 0.0, "estimate_K": 0.0, "resistance_factor": 1.0,
    }  # fmt: skip
    certificate = certify_pack(
        PRESET, MODEL, SPREAD, AROUND, all_cells(4, 4), Reserves(kept.changes, nothing)
    )
    assert not claim(certificate, "no thermistor").holds


def test_cells_that_are_all_alike_need_less_and_are_certified():
    alike = certify_pack(PRESET, MODEL, NO_SPREAD, AROUND, all_cells(2))
    assert alike.certified
    assert alike.cells_checked == 1 + 8
    assert alike.core_margin["whole_K_per_s"] < shown().core_margin["whole_K_per_s"]


@cache
def family():
    return verify_family(*load_pair("a123_26650_10C", None), samples=1000)


def test_a_family_is_certified_cell_by_cell_only_where_its_cells_do_not_touch(monkeypatch):
    preset, model = load_pair("a123_26650_10C", None)
    monkeypatch.setattr(certificate_module, "verify_family", lambda preset, model: family())
    for k, certified in ((0.02, False), (0.0, True)):
        certificate = certify_pack(preset, model, SPREAD, Surroundings(k), all_cells(4))
        assert certificate.certified == certified
        assert claim(certificate, "each cell").holds
        assert claim(certificate, "neighbours").holds == certified
    failing = replace(family(), violations=("a cell over a limit",))
    monkeypatch.setattr(certificate_module, "verify_family", lambda preset, model: failing)
    certificate = certify_pack(preset, model, SPREAD, Surroundings(0.0), all_cells(4))
    assert not certificate.certified


def test_the_command_prints_the_certificate_and_fails_with_what_is_not_certified():
    result = bms("verify", "--cells", "2", "--json")
    assert result.returncode == 0, result.stderr
    content = json.loads(result.stdout)
    assert content["certified"] is True
    assert {"voltage", "core", "surface", "neighbours"} <= {c["name"] for c in content["claims"]}
    assert content["spread"]["resistance"] == [0.95, 1.05]


def test_the_command_says_why_a_pack_is_not_certified_and_fails(monkeypatch, capsys):
    lacking = replace(shown(), claims=(replace(shown().claims[3], holds=False, reason="too hot"),))
    monkeypatch.setattr(command, "certify_pack", lambda *arguments, **settings: lacking)
    assert verify(cells=4) == 1
    printed = capsys.readouterr().out
    assert "NOT certified: core: too hot" in printed
    assert "speaks for: cells of paper_calibrated in series" in printed
    assert "not proven: contactors, pre-charge" in printed


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--cells", "193"], "--cells 193: from 1 to 192 cells"),
        (["--cells", "4", "--slips"], "--slips: is for one cell"),
        (["--cells", "4", "--boxes", "9"], "--boxes: is for one cell"),
        (["--cells", "4", "--preset", "lin2014"], "alpha2_per_s is not 1/(Rc Cc)"),
        (["--flow-w-per-k", "20"], "are for a pack; add --cells"),
        (["--per-thermistor", "2"], "are for a pack; add --cells"),
    ],
)
def test_options_that_do_not_fit_are_refused_in_one_line(options, told):
    result = bms("verify", *options)
    assert result.returncode == 2
    assert told in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_preset_whose_gain_is_another_is_refused():
    preset, model = load_pair("lin2014", None)
    with pytest.raises(InputError, match="alpha2_per_s"):
        certify_pack(preset, model, SPREAD, AROUND, all_cells(2))
