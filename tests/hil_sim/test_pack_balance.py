"""Passive balancing: the spread of a full pack shrinks, and nothing is bled that must not be."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bms.model.model_file import shipped_model_path
from bms.model.pair import load_pair
from bms.presets import preset_path
from hil_sim.pack.charge import charge_pack
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.plant import PackPlant, PackWire, obeyed_A
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.pack.summary import margins
from hil_sim.studies.pack._pack import lib

ROOT = Path(__file__).parents[2]
BMS = Path(sys.executable).with_name("bms")
PRESET, MODEL = load_pair("paper_calibrated", None)
NEARLY_FULL = replace(PRESET, initial=replace(PRESET.initial, soc=0.93))
COMPLETE, BLEED_ID = 4, 0x2B0
CELLS = 6


def settings_of(**changes):
    """A pack that is full soon, with 10 ohm across each cell."""
    return PackChargeSettings(
        NEARLY_FULL, MODEL, CELLS, **({"bleed_ohm": 10.0, "seed": 1} | changes)
    )


def spread(socs):
    return max(socs) - min(socs)


@cache
def balanced():
    return charge_pack(settings_of(balance_s=900.0))


def test_the_spread_of_a_full_pack_shrinks_and_no_limit_is_crossed():
    result = balanced()
    assert result.reason == "complete"
    assert spread(result.full_socs) > 0.01
    assert spread(result.final_socs) < 0.35 * spread(result.full_socs)
    assert (margins(result) >= 0.0).all()
    assert result.latched_faults == 0


def test_the_emptiest_cell_is_never_bled():
    result = balanced()
    emptiest = int(np.argmin(result.full_socs))
    assert result.final_socs[emptiest] == pytest.approx(result.full_socs[emptiest], abs=1e-4)


def test_without_resistors_the_spread_stays():
    result = charge_pack(settings_of(bleed_ohm=0.0, balance_s=100.0))
    assert spread(result.final_socs) == pytest.approx(spread(result.full_socs), abs=1e-3)


def test_what_is_counted_includes_what_was_bled():
    low, high = balanced().counted_soc
    assert high - low < 0.004
    assert high < 0.99


class Rig:
    """A full pack that is being balanced."""

    def __init__(self, **changes):
        settings = settings_of(**changes)
        self.ecu, self.plant = PackEcu(settings), PackPlant(settings)
        self.wire, self.charge, self.heard = PackWire(settings, self.plant), False, None
        self.run(20)
        self.charge = True
        self.run(1500, until=lambda: any(self.bleeds))
        assert any(self.bleeds) and self.ecu.state.pack.state == COMPLETE

    def run(self, periods, until=lambda: False, sent=lambda f: f, heard=lambda f: f, tamper=None):
        for _ in range(periods):
            self.plant.measure()
            if tamper is not None:
                tamper(self.plant)
            frames = sent(self.wire.publish(self.charge))
            self.heard = self.wire.hear(heard(self.ecu.exchange(frames)))
            self.plant.bleed(self.heard)
            self.plant.hold(obeyed_A(self.heard))
            if until():
                return

    @property
    def bleeds(self):
        """As the ECU has it."""
        return [bool(self.ecu.state.bleeds[i]) for i in range(CELLS)]

    @property
    def bled(self):
        """As the plant does."""
        return [bool(self.plant.fields.plant.cell[i].bleeds) for i in range(CELLS)]


def without(frame_id):
    return lambda frames: [frame for frame in frames if frame.frame_id != frame_id]


def test_what_the_ecu_says_the_plant_does():
    rig = Rig()
    rig.run(5)
    assert rig.bled == rig.bleeds
    assert not all(rig.bled)


def test_while_charging_nothing_is_bled():
    settings = settings_of()
    ecu, plant = PackEcu(settings), PackPlant(settings)
    wire, charging = PackWire(settings, plant), 0
    for period in range(400):
        plant.measure()
        heard = wire.hear(ecu.exchange(wire.publish(period > 20)))
        if heard.command_A < 0.0:
            charging += 1
            assert not any(ecu.state.bleeds[i] for i in range(CELLS))
        plant.hold(obeyed_A(heard))
    assert charging > 100


@pytest.mark.parametrize("lost", [0x200, 0x201, 0x202, 0x210, 0x220])
def test_in_a_period_without_a_message_or_a_page_nothing_is_bled(lost):
    rig = Rig()
    rig.run(1, sent=without(lost))
    assert not any(rig.bleeds)
    rig.run(1)
    assert any(rig.bleeds)


@pytest.mark.parametrize("quantity", ["voltage_V", "surface_temperature_K"])
def test_with_a_reading_that_is_no_number_nothing_is_bled(quantity):
    def tamper(plant):
        getattr(plant.measured, quantity)[0] = math.nan

    rig = Rig()
    rig.run(1, tamper=tamper)
    assert not any(rig.bleeds)


@pytest.mark.parametrize(
    ("current_A", "bleeds"), [(0.5, False), (-0.15, False), (0.05, True), (-0.05, True)]
)
def test_while_a_current_flows_nothing_is_bled_whoever_drives_it(current_A, bleeds):
    """What its sensor reads without any is no current."""

    def tamper(plant):
        plant.measured.current_A = current_A

    rig = Rig()
    rig.run(1, tamper=tamper)
    assert any(rig.bleeds) is bleeds


def test_cells_are_bled_from_the_gap_on_until_they_are_as_empty_as_the_emptiest():
    rig = Rig()
    rig.ecu.state.balance.least_soc, rig.ecu.state.balance.least_gap = 0.5, 0.02

    def bled_at(*socs):
        for i, soc in enumerate(socs):
            rig.ecu.state.bled_soc[i] = rig.ecu.state.pack.cell[i].soc.soc - soc
        rig.run(1)
        return rig.bleeds

    for i in range(CELLS):
        rig.ecu.state.bleeds[i] = 0
    assert bled_at(0.9, 0.81, 0.819, 0.821, 0.80, 0.85) == [True, False, False, True, False, True]
    assert bled_at(0.9, 0.81, 0.821, 0.801, 0.80, 0.80) == [True, False, True, True, False, False]
    assert bled_at(0.9, 0.81, 0.80, 0.801, 0.80, 0.819) == [True, False, False, True, False, False]
    assert bled_at(0.6, 0.49, 0.20, 0.51, 0.30, 0.40) == [True, False, False, True, False, False]


def test_what_was_bled_is_counted_by_ohms_law():
    rig = Rig()
    state, counted = rig.ecu.state, [rig.ecu.state.bled_soc[i] for i in range(CELLS)]
    expected, least_capacity_As = list(counted), state.pack.calibration.rcbf.capacity_As
    for _ in range(50):
        rig.run(1)
        for i in range(CELLS):
            charge_As = rig.plant.measured.voltage_V[i] / 10.0 * PRESET.timing.sampling_period_s
            expected[i] += rig.bleeds[i] * charge_As / least_capacity_As
    assert any(expected) and expected != counted
    assert [state.bled_soc[i] for i in range(CELLS)] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("constant", "values"),
    [
        ("resistor_ohm", (0.0, -10.0, math.nan, math.inf)),
        ("least_soc", (-0.01, 1.01, math.nan)),
        ("least_gap", (0.0, -0.01, 1.01, math.nan)),
    ],
)
def test_constants_of_balancing_that_cannot_be_let_nothing_be_bled(constant, values):
    rig = Rig()
    good = getattr(rig.ecu.state.balance, constant)
    for value in values:
        setattr(rig.ecu.state.balance, constant, value)
        rig.run(1)
        assert not any(rig.bleeds), value
        setattr(rig.ecu.state.balance, constant, good)
        rig.run(1)
        assert any(rig.bleeds)


def test_when_the_bleeds_do_not_come_any_more_the_plant_ends_them():
    rig = Rig()
    rig.run(5)
    rig.run(lib.PACK_BLEED_PERIODS + 2, heard=without(BLEED_ID))
    assert not any(rig.bled)
    assert any(rig.bleeds)


@pytest.mark.parametrize("damage", ["corrupted", "frozen"])
def test_bleeds_that_are_corrupted_or_frozen_are_not_obeyed(damage):
    rig, old = Rig(), {}

    def damaged(frame):
        if frame.frame_id != BLEED_ID:
            return frame
        if damage == "frozen":
            return old.setdefault(frame.data[1] >> 4, frame)
        return frame._replace(data=bytes([frame.data[0] ^ 1, *frame.data[1:]]))

    def heard(frames):
        return [damaged(frame) for frame in frames]

    rig.run(2 * lib.PACK_BLEED_PERIODS + 10, heard=heard)
    assert not any(rig.bled)


def test_a_charge_that_begins_anew_forgets_what_was_bled():
    rig = Rig()
    rig.run(600)
    assert max(rig.ecu.state.bled_soc[i] for i in range(CELLS)) > 0.002
    rig.charge = False
    rig.run(5)
    assert any(rig.bleeds), "at rest with the request off it goes on"
    for i, soc in enumerate(rig.plant.socs()):
        rig.wire._socs[i] = soc
    rig.run(20)
    rig.charge = True
    rig.run(3)
    assert max(rig.ecu.state.bled_soc[i] for i in range(CELLS)) == 0.0


def test_a_resistor_that_is_stuck_on_crosses_no_limit():
    rig = Rig()
    stuck = int(np.argmax(rig.plant.socs()))
    for _ in range(3000):
        rig.run(1)
        rig.plant.fields.plant.cell[stuck].bleeds = True
    peaks = rig.plant.peaks()
    assert (peaks[:, 3] <= PRESET.limits.max_voltage_V).all()
    assert (peaks[:, 0] <= PRESET.limits.max_soc).all()
    assert rig.heard.command_A == 0.0


def test_the_command_balances_and_says_the_spread_before_and_after(bms, tmp_path):
    """From empty: what capacities make of the spread is not counted, and stays."""
    options = ["--cells", 4, "--seed", 1, "--bleed-ohm", 5, "--balance-s", 200]
    code, out, _ = bms("sil", *options, "--out", tmp_path / "out", "--json")
    said = json.loads(out)
    assert (code, said["stop_reason"]) == (0, "complete")
    assert 0.0 < said["spread_at_end"] < said["spread_when_full"] - 0.002
    assert said["counted_fullest_soc"] - said["counted_emptiest_soc"] < 0.002
    page = (tmp_path / "out" / "report.html").read_text()
    assert f"{said['spread_when_full']:.4f} when it was full" in page


@pytest.mark.slow
def test_plant_and_ecu_balance_as_two_processes_as_they_do_in_one(bms, tmp_path):
    """Beside it the same plant with an ECU that was told of no resistors: nothing is bled."""
    preset = tmp_path / "nearly_full.toml"
    shipped = preset_path("paper_calibrated").read_text()
    assert shipped.count("\nsoc = 0.0001\n") == 1
    preset.write_text(shipped.replace("\nsoc = 0.0001\n", "\nsoc = 0.965\n"))
    pack = ["--cells", 4, "--preset", preset, "--model", shipped_model_path("paper_calibrated")]
    spreads = {}
    for ohm in (5, 0):
        bus = f"udp_multicast:239.74.165.{1 + (os.getpid() + ohm) % 250}"
        options = [*pack, "--seed", 1, "--bleed-ohm", 5, "--balance-s", 40]
        ecu = [BMS, "ecu", "--bus", bus, "--silence-s", "5", "--bleed-ohm", ohm, *pack]
        with subprocess.Popen([*map(str, ecu)], stdout=subprocess.PIPE) as process:
            code, out, err = bms("plant", "--bus", bus, "--answer-timeout-s", 5, *options, "--json")
            assert code == 0, out + err
            assert process.wait(30) == 0
        spreads[ohm] = json.loads(out)["spread_at_end"]
    code, out, _ = bms("sil", *options, "--json")
    assert spreads[5] == json.loads(out)["spread_at_end"]
    assert spreads[5] < spreads[0] - 3e-4


@pytest.mark.parametrize(
    ("command", "option"),
    [
        *(("sil", "--bleed-ohm"), ("sil", "--balance-s")),
        *(("plant", "--bleed-ohm"), ("plant", "--balance-s"), ("ecu", "--bleed-ohm")),
    ],
)
def test_balancing_one_cell_is_refused_in_one_line(bms, command, option):
    bus = () if command == "sil" else ("--bus", "udp_multicast:239.74.165.251")
    code, out, err = bms(command, *bus, option, 10)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert "add --cells" in err


BALANCE = "firmware_c/pack_ecu/pack_balance.c"
BROKEN = {
    "symptoms": ("(symptoms == 0u) && ", "missing"),
    "gap": ("(soc - lowest_soc > least_gap)", "emptiest"),
}


@pytest.mark.slow
@pytest.mark.parametrize("broken", BROKEN)
def test_without_its_rule_a_cell_is_bled_that_must_not_be(tmp_path, broken):
    text, _ = BROKEN[broken]
    tree = tmp_path / "tree"
    for folder in ("firmware_c", "hil_sim/native", "hil_sim/studies/pack/native"):
        shutil.copytree(ROOT / folder, tree / folder)
    original = (tree / BALANCE).read_text()
    assert original.count(text) == 1
    other = "" if text.endswith("&& ") else "true"
    (tree / BALANCE).write_text(original.replace(text, other))
    command = [sys.executable, "-m", "tests.hil_sim.balance_mutant", tree, tmp_path / "out"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert BROKEN[broken][1] in done.stdout
