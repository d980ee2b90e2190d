"""Faults of a pack: each ends in 0 A within its deadline, and not without its check."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bms.model.pair import load_pair
from hil_sim.bus.catalog import FirstFault
from hil_sim.pack.charge import charge_pack
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.faults import BEGIN_PERIOD, FAULTS, PackFault, complaint, run_fault
from hil_sim.pack.plant import PackPlant, PackWire, obeyed_A
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.pack.summary import margins

ROOT = Path(__file__).parents[2]
REQUEST_ID, PLUG_IN_ID = 0x202, 0x230
PRESET, MODEL = load_pair("paper_calibrated", None)


def settings_of(cells=6, **changes):
    return PackChargeSettings(PRESET, MODEL, cells, **changes)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_no_current_flows_after_the_deadline_and_the_fault_has_its_name(fault: PackFault) -> None:
    result = run_fault(settings_of(16), fault, fault.stop_periods + 20)
    assert complaint(result, fault) is None
    assert (margins(result) >= 0.0).all(), "a cell has crossed a limit meanwhile"


def test_without_a_fault_the_same_periods_have_current_and_no_symptom():
    nothing = PackFault("none", 0, (FirstFault.OUT_OF_STEP,))
    result = run_fault(settings_of(16), nothing, 620)
    assert "A, 0 periods" in complaint(result, nothing)
    assert result.latched_faults == 0
    assert set(result.active_faults[10:]) == {0}


@pytest.mark.parametrize(
    ("group_id", "name"),
    [(0x210, FirstFault.ELECTRICAL_MISSING), (0x220, FirstFault.THERMAL_MISSING)],
)
@pytest.mark.parametrize("pages", [(0,), (1,), (5,), (1, 3), (4, 5)])
def test_the_page_of_any_cell_is_missed(pages, group_id, name):
    def lose(frame, since):
        is_page = frame.frame_id == group_id and frame.data[1] >> 4 in pages
        return [] if is_page else [frame]

    fault = PackFault("a page", 0, (name,), delivery=lose)
    result = run_fault(settings_of(16), fault, 10)
    assert complaint(result, fault) is None
    assert result.faulty_cell == 3 * pages[0] + 1


@pytest.mark.parametrize("kind", ["voltage", "temperature"])
def test_a_page_that_comes_late_is_missing_for_a_family_as_well(kind):
    """Its observer asks for no estimate, so nothing else ends a charge by old temperatures."""
    (fault,) = [one for one in FAULTS if one.name == f"{kind} page a period late"]
    settings = PackChargeSettings(*load_pair("a123_26650_10C", None), 6)
    assert complaint(run_fault(settings, fault, 10), fault) is None


def test_one_lost_page_stops_for_its_period_and_the_charge_goes_on_where_it_was():
    """A charge that began anew would take the states of charge at plug-in over again."""

    def lose(frame, since):
        return [] if frame.frame_id == 0x210 and frame.data[1] >> 4 == 1 and since == 0 else [frame]

    fault = PackFault("a lost page", 0, (FirstFault.ELECTRICAL_MISSING,), delivery=lose)
    result = run_fault(settings_of(6, max_time_s=1e4), fault, 5000)
    assert result.commands_A[BEGIN_PERIOD] == 0.0
    assert result.commands_A[BEGIN_PERIOD + 1] < 0.0
    assert result.latched_faults == 0
    assert min(result.commands_A[BEGIN_PERIOD + 100 :]) == pytest.approx(-23.0, abs=0.01)
    assert (margins(result) >= 0.0).all()


def test_an_ecu_of_other_cells_than_the_plant_gives_no_current():
    """The plant has six cells, the ECU five in the same two pages, so that all of them come."""
    ecu, plant = PackEcu(settings_of(5)), PackPlant(settings_of(6))
    wire = PackWire(settings_of(6), plant)
    for period in range(80):
        plant.measure()
        heard = wire.hear(ecu.exchange(wire.publish(charge=period > 20)))
        assert heard.command_A == 0.0 or np.isnan(heard.command_A)
        plant.hold(None)
    assert heard.latched_faults >> FirstFault.REQUEST_INVALID & 1
    assert heard.latched_faults >> FirstFault.CORRUPTED_FRAMES & 1


@pytest.mark.parametrize("missed", [0, 1, 49, 50])
def test_an_ecu_that_restarts_in_mid_charge_begins_none_whenever_it_hears_the_request(missed):
    """The states of charge at plug-in are of the past; only a request that was off begins anew."""
    plant = PackPlant(settings_of())
    ecu, wire = PackEcu(settings_of()), PackWire(settings_of(), plant)
    for period in range(250):
        plant.measure()
        frames = wire.publish(charge=period > 20)
        if period == 100:
            assert plant.current_A < -1.0
            ecu = PackEcu(settings_of())
        if 100 <= period < 100 + missed:
            frames = [frame for frame in frames if frame.frame_id != REQUEST_ID]
        heard = wire.hear(ecu.exchange(frames))
        plant.hold(obeyed_A(heard))
        assert period < 100 or heard.command_A == 0.0 or np.isnan(heard.command_A)


@pytest.mark.parametrize("page", [0, 1])
def test_until_every_cell_s_charge_was_told_a_request_is_wrong(page):
    """An ECU that starts knows of no cell how full it is, whatever its memory had in it."""
    plant = PackPlant(settings_of())
    ecu, wire, judged = PackEcu(settings_of()), PackWire(settings_of(), plant), 0
    for _ in range(30):
        plant.measure()
        frames = [
            frame
            for frame in wire.publish(charge=True)
            if frame.frame_id != PLUG_IN_ID or frame.data[1] >> 4 != page
        ]
        ecu.exchange(frames)
        assert ecu.state.command_A == 0.0
        if ecu.state.has_started:
            assert ecu.state.pack.monitor.active >> FirstFault.REQUEST_INVALID & 1
            judged += 1
    assert judged > 10


@pytest.mark.parametrize("off_periods", [1, 2, 4])
def test_a_charge_that_is_asked_for_anew_counts_from_states_of_charge_that_were_told_since(
    off_periods,
):
    """96 cells are told in five periods; until then no cell is taken for what it was before."""
    settings = settings_of(96)
    plant = PackPlant(settings)
    ecu, wire = PackEcu(settings), PackWire(settings, plant)
    told = plant.socs()
    for period in range(150):
        plant.measure()
        if period == 100:
            assert plant.current_A < -1.0
            told = plant.socs()
            for cell, soc in enumerate(told):
                wire._socs[cell] = soc
        heard = wire.hear(
            ecu.exchange(wire.publish(20 < period < 100 or period >= 100 + off_periods))
        )
        if period >= 100 + off_periods and heard.command_A < 0.0:
            counted = [ecu.state.pack.cell[cell].soc.soc for cell in range(96)]
            np.testing.assert_array_less(np.array(told) - 1e-4, counted)
        plant.hold(obeyed_A(heard))


@pytest.mark.parametrize("cells", [1, 3, 192])
def test_a_string_of_any_length_is_heard_without_a_symptom(cells):
    """The longest one fills every page that there is."""
    plant = PackPlant(settings_of(cells))
    ecu, wire = PackEcu(settings_of(cells)), PackWire(settings_of(cells), plant)
    for _ in range(60):
        plant.measure()
        ecu.exchange(wire.publish(charge=False))
        assert (ecu.state.monitor.active, ecu.state.pack.monitor.active) == (0, 0)
    assert ecu.state.has_started


def test_two_commands_in_one_period_move_no_current():
    """The charger's side: the protection proves no sender."""
    ecu, plant = PackEcu(settings_of()), PackPlant(settings_of())
    wire = PackWire(settings_of(), plant)
    for period in range(60):
        plant.measure()
        answer = ecu.exchange(wire.publish(charge=period > 20))
        heard = wire.hear(answer)
        plant.hold(obeyed_A(heard))
    assert plant.current_A < -1.0
    plant.measure()
    answer = ecu.exchange(wire.publish(charge=True))
    heard = wire.hear([*answer, answer[-1]])
    assert np.isnan(heard.command_A)
    plant.hold(obeyed_A(heard))
    assert plant.current_A == 0.0


def exchanged(first, second):
    def change(plant, since, kept):
        surfaces = plant.measured.surface_temperature_K
        surfaces[first], surfaces[second] = surfaces[second], surfaces[first]

    return change


def test_exchanged_thermistors_are_not_seen_and_change_the_name_of_the_cell_but_not_the_current():
    """All cells have the same constants: the same readings give the same bounds together."""
    plain = charge_pack(settings_of(16))
    weakest = max(plain.governed, key=plain.governed.get)
    coolest = int(np.argmin(plain.peaks[:, 2])) + 1
    wrong = exchanged(weakest - 1, coolest - 1)
    result = charge_pack(settings_of(16), tamper=lambda plant: wrong(plant, 0, {}))
    assert result.reason == "complete"
    assert result.latched_faults == 0
    assert result.governed[coolest] > 1000 and weakest not in result.governed
    assert result.peaks[:, 1] == pytest.approx(plain.peaks[:, 1], abs=0.01)
    assert (margins(result) >= 0.0).all()


NETWORK, ECU = "firmware_c/pack_ecu/pack_network.c", "firmware_c/pack_ecu/pack_ecu.c"
SYMPTOMS, E2E = "firmware_c/pack/pack_symptoms.c", "firmware_c/src/e2e.c"
AGE = (NETWORK, "if (!verdict.is_usable ||\n            is_late(", "if (is_late(")
LATE = (NETWORK, "return ahead != *phase;", "return false;")
CRC = (E2E, "data[0] != e2e_crc(data, length, data_ids)", "false")
SUM = (NETWORK, "is_electrical && sum_deviates(ecu)", "false")


def unlimited(reading, limits, fault):
    """The range of a reading that nobody looks at."""
    return (SYMPTOMS, f"outside_if({reading}, &limits->{limits}, FAULT_{fault}_RANGE)", "0u")


MUTANTS = {
    # A page that does not come is a symptom, and leaves its cells without readings.
    "age of pages": (
        [AGE, LATE],
        ["voltage page missing", "temperature page missing", "voltage page too short"],
    ),
    "checksum": (
        [CRC],
        ["voltage page corrupted", "temperature page corrupted"],
    ),
    # Such a page is missed under its own number as well.
    "number of a page": (
        [CRC, AGE, LATE],
        ["voltage page under another's number"],
    ),
    "counter": (
        [(E2E, "(steps == 0u) ||", ""), LATE],
        ["voltage page frozen", "temperature page frozen", "voltage page from two senders"],
    ),
    # What has fallen behind counts on by one, as if all were well.
    "phase of counters": (
        [LATE],
        ["voltage page a period late", "temperature page a period late"],
    ),
    "phase of messages": (
        [(NETWORK, "ecu->is_usable[i] = false;", "ecu->is_usable[i] = true;")],
        ["coolant a period late", "request a period late"],
    ),
    "number of cells": (
        [(NETWORK, "ecu->is_disturbed = true;\n        return true;", "return true;")],
        ["page of cells that are not there"],
    ),
    "age of states of charge": (
        [(NETWORK, "ecu->plug_in_age[page]++;", ";")],
        ["plug-in page missing"],
    ),
    "sum of voltages": (
        [SUM],
        ["a cell's voltage off by 0.3 V", "the string's voltage off by 1 V"],
    ),
    # Of many cells the sum leaves so much that the deviation is seen first.
    "sum and deviation of voltages": (
        [SUM, (SYMPTOMS, "pack->soc_known && voltage_deviates(pack, index, reading)", "false")],
        ["a cell's voltage stuck"],
    ),
    # What the network refuses is told to the core, and overrides what the core decides.
    "stop by the network": (
        [
            (ECU, "is_stopped(ecu) ? 0.0f : ecu->reference_current_A", "ecu->reference_current_A"),
            (ECU, "|| is_stopped(ecu) ", ""),
        ],
        ["the string's voltage off by 1 V", "a cell's voltage off by 0.3 V"],
    ),
    # Each value that is no number or out of range is caught twice: by the core and by the sum.
    "range of voltages": (
        [unlimited("reading.voltage_V", "voltage_V", "VOLTAGE"), SUM],
        ["a cell's voltage not a number"],
    ),
    "range of surfaces": (
        [
            (
                SYMPTOMS,
                "outside_if(reading.surface_temperature_K, &limits->surface_temperature_K,\n"
                "                             FAULT_SURFACE_RANGE)",
                "0u",
            )
        ],
        ["thermistor wire open", "thermistor reads its lowest"],
    ),
    "surface deficit": ([(SYMPTOMS, "limits->surface_deficit_K", "1e9f")], ["thermistor stuck"]),
    "range of the coolant": (
        [unlimited("outlet_K", "coolant_temperature_K", "COOLANT")],
        ["no coolant reading"],
    ),
    "range of the current": (
        [unlimited("reading.current_A", "current_A", "CURRENT")],
        ["no current reading"],
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("check", MUTANTS)
def test_without_its_check_a_fault_is_met_no_more(tmp_path, check):
    changes, rows = MUTANTS[check]
    tree = tmp_path / "tree"
    for folder in ("firmware_c", "hil_sim/native", "hil_sim/studies/pack/native"):
        shutil.copytree(ROOT / folder, tree / folder)
    for source, text, other in changes:
        original = (tree / source).read_text()
        assert original.count(text) == 1, text
        (tree / source).write_text(original.replace(text, other))
    command = [sys.executable, "-m", "tests.hil_sim.pack_mutant", tree, tmp_path / "out", *rows]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    said = done.stdout.strip().splitlines()[-len(rows) :]
    assert "kept" not in said, dict(zip(rows, said))


def test_every_fault_has_a_mutant_that_shows_it_red():
    shown = {row for _, rows in MUTANTS.values() for row in rows}
    assert {fault.name for fault in FAULTS} - shown == {"a cell's voltage out of range"}


@pytest.mark.parametrize("times", [4, 5])
def test_a_temperature_page_may_be_lost_four_times_in_a_minute(times):
    lost_at = set(range(0, 10 * times, 10))

    def lose(frame, since):
        is_lost = frame.frame_id == 0x220 and frame.data[1] >> 4 == 0 and since in lost_at
        return [] if is_lost else [frame]

    fault = PackFault("lost pages", 0, (FirstFault.OUT_OF_DOMAIN,), delivery=lose)
    result = run_fault(settings_of(), fault, 60)
    assert all(result.commands_A[BEGIN_PERIOD + since] == 0.0 for since in lost_at)
    latched = bool(result.latched_faults >> FirstFault.OUT_OF_DOMAIN & 1)
    assert latched == (times == 5)
    assert (result.commands_A[-1] == 0.0) == latched


def test_readings_of_chance_under_right_checksums_bring_no_other_current_than_0_A():
    """Some cell's reading is no number, or far from what the pack can be, in every period."""
    settings = settings_of(9)
    rng = np.random.default_rng(1)
    for _ in range(40):
        ecu, plant = PackEcu(settings), PackPlant(settings)
        wire = PackWire(settings, plant)
        for period in range(90):
            plant.measure()
            if period >= 70:
                spoil(plant, rng)
            heard = wire.hear(ecu.exchange(wire.publish(charge=period > 20)))
            plant.hold(obeyed_A(heard))
            if period == 69:
                assert heard.command_A < -10.0
            if period >= 70:
                assert heard.command_A == 0.0


def spoil(plant, rng):
    """One reading of one cell, or one that all share, becomes another."""
    measured, cell = plant.measured, int(rng.integers(9))
    value = rng.choice([np.nan, np.inf, -np.inf, 1e30, -1e30, 0.0])
    match int(rng.integers(5)):
        case 0:
            measured.voltage_V[cell] = value
        case 1:
            measured.surface_temperature_K[cell] = value
        case 2:
            measured.coolant_in_K = value
        case 3:
            plant.pack_voltage_V = value
        case _:
            measured.current_A = rng.choice([np.nan, np.inf, -np.inf, 1e30, -1e30])
