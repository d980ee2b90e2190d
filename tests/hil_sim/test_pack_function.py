"""State of function: what the ECU allows for 10 s the true pack bears for 10 s."""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bms.model.pair import load_pair
from codegen.can_database import PACK, load_database
from hil_sim.pack.admitted import Ahead
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.function_study import FOXBMS_1, FOXBMS_2, OURS, SLACK_A, figures, samples
from hil_sim.pack.plant import PackPlant, PackWire, obeyed_A
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.pack.trapezoid import Readings, Trapezoid
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import Core
from tests.hil_sim.function_mutant import nearly_full
from tests.hil_sim.pack_rig import PackRig, core_of, ordinary

ROOT = Path(__file__).parents[2]
PRESET, MODEL = load_pair("paper_calibrated", None)
STRONGEST_A = PRESET.limits.reference_current_A
EVERY = 100


def settings_of(cells=8, **changes):
    return PackChargeSettings(PRESET, MODEL, cells, **changes)


@pytest.fixture(scope="module")
def found():
    return [one for seed in (0, 1) for one in samples(settings_of(seed=seed), EVERY)]


def test_what_is_allowed_for_10_s_crosses_no_limit_when_it_is_held_for_10_s(found):
    assert len(found) > 80
    assert all((one.over[OURS] <= 0.0).all() for one in found)
    assert figures(found)[OURS]["over_promised"] == 0


def test_it_is_most_of_what_the_pack_bears_and_more_than_the_trapezoids_allow(found):
    said = figures(found)
    assert said[OURS]["share_of_borne"] > 0.6
    assert said[OURS]["share_of_borne"] > said[FOXBMS_2]["share_of_borne"] + 0.1
    assert said[FOXBMS_2]["share_of_borne"] >= said[FOXBMS_1]["share_of_borne"]


def test_for_10_s_no_more_is_allowed_than_now(found):
    assert all(one.promised_A[OURS] >= one.now_A for one in found)
    assert min(one.now_A for one in found) == pytest.approx(STRONGEST_A)


def test_fewer_thermistors_allow_less_but_never_too_much():
    few = list(samples(settings_of(per_thermistor=4), EVERY))
    assert all((one.over[OURS] <= 0.0).all() for one in few)
    assert 0.2 < figures(few)[OURS]["share_of_borne"] < 0.7


def test_a_core_is_never_hotter_than_its_estimate_and_what_is_in_reserve():
    """The one assumption on estimates that the bound rests on."""
    settings = settings_of(16, seed=2)
    ecu, plant = PackEcu(settings), PackPlant(settings)
    wire = PackWire(settings, plant)
    most_K = -math.inf
    for period in range(5000):
        plant.measure()
        plant.hold(obeyed_A(wire.hear(ecu.exchange(wire.publish(charge=period > 20)))))
        if period > 20:
            cells = ecu.state.pack.cell
            gaps = [true - cells[i].estimate.core_temperature_K
                    for i, true in enumerate(plant.core_K())]  # fmt: skip
            most_K = max(most_K, *gaps)
    assert most_K < 0.5 * settings.horizons()[1]["core_above_estimate_K"]


FUNCTION = "firmware_c/pack/pack_function.c"
ECU = "firmware_c/pack_ecu/pack_ecu.c"
# What this period's decision leaves bounds the promise as well.
DECISION = (ECU, "? numeric_larger(ecu->allowed_now_A, decision->lower_A)", "? ecu->allowed_now_A")
BROKEN = {
    "core": [(FUNCTION, "(core_left_K_per_s >= 0.0f)", "(core_left_K_per_s >= -1e9f)"), DECISION],
    "voltage": [
        (FUNCTION, "(voltage_V <= k->max_voltage_V)", "(voltage_V <= 1e9f)"),
        (FUNCTION, "(soc <= k->max_soc)", "(soc <= 1e9f)"),
        DECISION,
    ],
}


def test_without_time_ahead_more_is_allowed_than_the_pack_bears(monkeypatch):
    """Equal cells, so that nothing is in reserve for a smaller or a worse one, nearly full."""
    right = PackChargeSettings.horizons
    settings = nearly_full(PRESET, MODEL)
    assert all((one.over[OURS] <= 0.0).all() for one in samples(settings, 10))
    monkeypatch.setattr(
        PackChargeSettings, "horizons", lambda own: [one | {"horizon_s": 0.1} for one in right(own)]
    )
    assert any((one.over[OURS] > 0.0).any() for one in samples(settings, 10))


@pytest.mark.slow
@pytest.mark.parametrize("broken", BROKEN)
def test_without_a_condition_more_is_allowed_than_the_pack_bears(tmp_path, broken):
    tree = tmp_path / "tree"
    for folder in ("firmware_c", "hil_sim/native", "hil_sim/studies/pack/native"):
        shutil.copytree(ROOT / folder, tree / folder)
    for source, text, other in BROKEN[broken]:
        original = (tree / source).read_text()
        assert original.count(text) == 1, text
        (tree / source).write_text(original.replace(text, other))
    command = [sys.executable, "-m", "tests.hil_sim.function_mutant", tree, tmp_path / "out"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    worst = float(done.stdout.strip().splitlines()[-1])
    assert worst > 0.0


SOON = settings_of().horizons()[1]


@cache
def ordinary_core():
    return Core(PRESET, MODEL, ordinary("paper_calibrated"))


def rig_of(cells=3, soc=0.5, kelvin=285.0):
    """A pack of an ordinary spread that charges at a state of charge of one half."""
    rig = PackRig(ordinary_core(), cells)
    rig.socs = [soc] * cells
    rig.voltages = [PRESET.cell.ocv(soc)] * cells
    rig.surfaces = [kelvin] * cells
    rig.step(60, coolant_in_K=kelvin, coolant_out_K=kelvin)
    rig.step(charge=True)
    return rig


def allowed_of(pack, horizon):
    worst = ffi.new("pack_worst_t *", lib.pack_worst(pack))
    return lib.pack_function_A(pack, worst, ffi.new("pack_horizon_t *", horizon))


def allowed_A(rig, **changes):
    return allowed_of(rig.pack, SOON | changes)


def test_cold_and_a_third_full_all_that_is_asked_is_allowed():
    assert allowed_A(rig_of(soc=0.3)) == STRONGEST_A


def test_at_the_voltage_limit_it_is_what_the_open_circuit_voltage_after_10_s_leaves():
    """By bisection of the voltage alone, in double precision."""
    rig = rig_of(soc=0.96)
    constants = rig.core.calibration.rcbf

    def left_V(strength_A):
        soc = 0.96 + rig.core.calibration.soc_error + 10.0 * strength_A / constants.capacity_As
        ohmic_V = constants.ohmic_resistance_ohm * strength_A
        return PRESET.limits.max_voltage_V - constants.voltage_margin_V - float(
            np.interp(soc, PRESET.cell.ocv.soc, PRESET.cell.ocv.voltage_V)
        ) - ohmic_V  # fmt: skip

    low, high = 0.0, -STRONGEST_A
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if left_V(middle) >= 0.0 else (low, middle)
    assert 1.0 < low < 22.0
    assert allowed_A(rig) == pytest.approx(-low, abs=0.02)


def test_the_hottest_and_the_fullest_cell_decide_wherever_they_are():
    for place in range(3):
        hot = rig_of(kelvin=312.0)
        hot.surfaces[place] = 318.0
        hot.step()
        every = rig_of(kelvin=312.0)
        every.surfaces = [318.0] * 3
        every.step()
        assert STRONGEST_A < allowed_A(hot) < 0.0
        assert allowed_A(hot) <= allowed_A(every)
        full = rig_of()
        full.socs[place] = 0.98
        full.step(charge=False)
        full.step(charge=True)
        assert allowed_A(full) > allowed_A(rig_of())


def test_before_a_charge_and_when_full_nothing_is_allowed():
    rig = rig_of()
    assert allowed_A(rig) < 0.0
    full = rig_of(soc=0.995)
    assert full.pack.state == 4
    assert allowed_A(full) == 0.0
    fresh = PackRig(core_of("paper_calibrated"), 2)
    fresh.step(60)
    assert allowed_A(fresh) == 0.0


@pytest.mark.parametrize("reading", ["surfaces", "voltages"])
@pytest.mark.parametrize("place", [0, 2])
def test_a_reading_that_is_no_number_allows_nothing(reading, place):
    rig = rig_of()
    getattr(rig, reading)[place] = math.nan
    rig.step()
    assert allowed_A(rig) == 0.0


@pytest.mark.parametrize("reading", ["coolant_in_K", "coolant_out_K", "current_A"])
def test_a_shared_reading_that_is_no_number_allows_nothing(reading):
    rig = rig_of()
    rig.step(**{reading: math.nan})
    assert allowed_A(rig) == 0.0


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("member", ["surface_temperature_K", "soc", "estimate"])
def test_a_state_that_is_no_number_allows_nothing_without_any_symptom(member, place):
    rig = rig_of()
    cell = rig.pack.cell[place]
    if member == "surface_temperature_K":
        cell.surface_temperature_K = math.nan
    elif member == "soc":
        cell.soc.soc = math.nan
    else:
        cell.estimate.core_temperature_K = math.nan
    assert allowed_A(rig) == 0.0


@pytest.mark.parametrize("member", SOON)
@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
def test_a_constant_that_cannot_be_allows_nothing(member, value):
    assert allowed_A(rig_of(), **{member: value}) == 0.0


def test_constants_that_were_never_set_allow_nothing():
    assert allowed_of(rig_of().pack, {}) == 0.0


def test_a_stated_family_is_allowed_nothing_as_its_bounds_are_not_these():
    assert PackChargeSettings(*load_pair("a123_26650_10C", None), 2).horizons() == [{}, {}]


def test_without_a_calibration_nothing_is_allowed():
    pack = ffi.new("pack_t *")
    lib.pack_init(pack, ffi.NULL)
    assert allowed_of(pack, SOON) == 0.0


def test_the_bus_has_both_currents_and_the_spread_towards_the_safe_side():
    settings = settings_of(5)
    message = load_database(PACK).get_message_by_name("PackFunction")
    spread = load_database(PACK).get_message_by_name("PackSpread")
    ecu, plant = PackEcu(settings), PackPlant(settings)
    wire, seen = PackWire(settings, plant), 0
    for period in range(3000):
        plant.measure()
        answer = ecu.exchange(wire.publish(charge=period > 20))
        heard = wire.hear(answer)
        said = {f.frame_id: f.data for f in answer}
        values = message.decode(said[message.frame_id])
        assert ecu.state.allowed_now_A - 4.5e-5 <= values["AllowedCurrentNow"]
        assert values["AllowedCurrentNow"] <= ecu.state.allowed_now_A + 2e-3
        assert values["AllowedCurrentFor10s"] <= ecu.state.allowed_soon_A + 2e-3
        assert values["AllowedCurrentFor10s"] >= values["AllowedCurrentNow"]
        if heard.governing_cell:
            assert values["AllowedCurrentNow"] >= heard.limit_A - 2e-3
            seen += 1
        if spread.frame_id not in said:
            plant.hold(obeyed_A(heard))
            continue
        socs = spread.decode(said[spread.frame_id], decode_choices=False)
        if ecu.state.pack.soc_known:
            known = [ecu.state.pack.cell[i].soc.soc for i in range(5)]
            assert socs["HighestStateOfCharge"] == pytest.approx(max(known), abs=2e-5)
            assert socs["LowestStateOfCharge"] == pytest.approx(min(known), abs=2e-5)
        else:
            assert socs["LowestStateOfCharge"] > 1.3107  # not available
        plant.hold(obeyed_A(heard))
    assert seen > 50


@pytest.mark.parametrize("lost", [0x200, 0x201, 0x202, 0x210, 0x220])
def test_while_a_message_or_page_is_missing_nothing_is_allowed(lost):
    settings = settings_of(5)
    ecu, plant = PackEcu(settings), PackPlant(settings)
    wire, heard = PackWire(settings, plant), None
    for period in range(120):
        plant.measure()
        frames = wire.publish(charge=period > 20)
        if period == 110:
            assert heard.allowed_soon_A < -1.0
            frames = [frame for frame in frames if frame.frame_id != lost]
        heard = wire.hear(ecu.exchange(frames))
        if period == 110:
            assert heard.allowed_now_A == heard.allowed_soon_A == 0.0
        plant.hold(obeyed_A(heard))
    assert heard.allowed_soon_A < -1.0


def test_looking_ahead_leaves_the_plant_as_it_is_and_agrees_with_holding():
    settings = settings_of(3)
    plant = PackPlant(settings)
    ahead = Ahead(settings, plant, 10.0)
    before = plant.core_K()
    over = ahead.over(-20.0)
    assert plant.core_K() == before
    plant.measure()
    for _ in range(100):
        plant.hold(-20.0)
    limits = settings.preset.limits
    assert over[1] == pytest.approx(max(plant.core_K()) - limits.max_core_temperature_K, abs=0.05)
    assert over[0] == pytest.approx(max(plant.socs()) - limits.max_soc, abs=1e-6)


@pytest.mark.parametrize(
    ("changes", "share"),
    [
        ({}, 1.0),
        ({"highest_voltage_V": 3.535}, 0.5),
        ({"highest_voltage_V": 3.55}, 0.0),
        ({"hottest_K": 318.0}, 0.5),
        ({"hottest_K": 323.0}, 0.0),
        ({"coldest_K": 258.15}, 0.5),
        ({"highest_soc": 0.90}, 0.5),
        ({"highest_soc": 0.96}, 0.0),
        ({"hottest_K": math.nan}, 0.0),
    ],
)
def test_the_trapezoid_falls_linearly_between_its_points(changes, share):
    whole = {"highest_voltage_V": 3.3, "hottest_K": 300.0, "coldest_K": 299.0, "highest_soc": 0.5}
    allowed = Trapezoid(PRESET, by_soc=True).allowed_A(Readings(**(whole | changes)))
    assert allowed == pytest.approx(share * STRONGEST_A)
    assert SLACK_A < 0.02
