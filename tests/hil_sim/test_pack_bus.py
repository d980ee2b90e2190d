"""A pack over its bus: frames that any tool reads, and the currents of the core by itself."""

from __future__ import annotations

import math
from functools import cache

import cantools.autosar
import numpy as np
import pytest

from bms.model.pair import load_pair
from codegen.can_database import PACK, data_ids, load_database
from hil_sim.logs import read_log
from hil_sim.logs.recorder import Recorder
from hil_sim.pack.charge import OFF_PERIODS, charge_pack
from hil_sim.pack.node import PackPlantNode
from hil_sim.pack.settings import PACK_VOLTAGE_STEP_V, PackChargeSettings, spread_of
from hil_sim.pack.spread_kind import SpreadKind
from hil_sim.run.result import STOP_SILENT
from hil_sim.studies.pack._pack import ffi, lib
from hil_sim.studies.pack.engine import BLOCK_PERIODS, PackCharge
from hil_sim.studies.pack.spread import draw_pack

DATABASE = load_database(PACK)
BY_ID = {message.frame_id: message for message in DATABASE.messages}
SYNC_ID, COMMAND_ID = 0x080, 0x280
CELLS = 5
PRESET, MODEL = load_pair("paper_calibrated", None)


def settings_of(cells=CELLS, **changes):
    return PackChargeSettings(PRESET, MODEL, cells, **changes)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A whole charge of an uneven number of cells, and every frame of its log."""
    path = tmp_path_factory.mktemp("pack") / "can.log"
    with Recorder(path) as recorder:
        result = charge_pack(settings_of(seed=3), recorder)
    return result, list(read_log(path))


def decoded(frames):
    """Physical values by cantools alone of frames whose protection cantools finds right."""
    values = {}
    for frame in frames:
        message = BY_ID[frame.frame_id]
        if data_ids(message):
            counter = frame.data[1] & 0x0F
            assert cantools.autosar.check_profile2_crc(
                bytearray(frame.data), data_ids(message)[counter]
            ), message.name
        values |= message.decode(frame.data, decode_choices=False)
    return values


def periods_of(log):
    """Frames up to and with SYNC, and those of the answer to it, of each period."""
    periods, asked, answer = [], [], []
    for frame in log:
        if answer and answer[-1].frame_id == COMMAND_ID:
            periods.append((asked, answer))
            asked, answer = [], []
        has_sync = bool(asked) and asked[-1].frame_id == SYNC_ID
        (answer if has_sync else asked).append(frame)
    return [*periods, (asked, answer)]


@cache
def signal_of(name):
    return next(s for m in DATABASE.messages for s in m.signals if s.name == name)


def value(values, name):
    """NaN for what is not available: above the signal's range.

    Else the number of steps that cantools found, as float32 has it, which the firmware counts in.
    """
    signal, got = signal_of(name), values[name]
    if got > signal.maximum + 1e-9:
        return math.nan
    return float(np.float32(signal.scale) * np.float32(round(got / signal.scale)))


def test_a_pack_charges_until_its_fullest_cell_is_full_and_no_cell_crosses_a_limit(recorded):
    result, _ = recorded
    limits = PRESET.limits
    assert result.reason == "complete"
    assert (result.peaks[:, 0] <= limits.max_soc).all()
    assert (result.peaks[:, 1] <= limits.max_core_temperature_K).all()
    assert (result.peaks[:, 2] <= limits.max_surface_temperature_K).all()
    assert (result.peaks[:, 3] <= limits.max_voltage_V).all()
    assert max(result.final_socs) > 0.95


def test_every_frame_is_intact_and_in_the_database_by_cantools_alone(recorded):
    _, log = recorded
    for frame in log:
        decoded([frame])
    said = {BY_ID[frame.frame_id].name for frame in log}
    assert said == {
        name
        for name in (m.name for m in DATABASE.messages)
        if not name[-1].isdigit() or name.endswith("1")  # five cells are in each group's first
    }


def test_every_page_counts_its_own_frames(recorded):
    _, log = recorded
    last = {}
    for frame in log:
        message = BY_ID[frame.frame_id]
        if data_ids(message):
            key = (frame.frame_id, frame.data[1] >> 4 if message.is_multiplexed() else None)
            counter = frame.data[1] & 0x0F
            assert counter == (last[key] + 1) % 16 if key in last else counter == 0, message.name
            last[key] = counter


def test_places_beyond_the_last_cell_are_not_available(recorded):
    _, log = recorded
    asked, _ = periods_of(log)[0]
    values = decoded(asked)
    assert not math.isnan(value(values, "Cell005Voltage"))
    assert math.isnan(value(values, "Cell006Voltage"))
    assert math.isnan(value(values, "Thermistor006Temperature"))


def test_the_core_alone_gives_the_commands_of_the_log_for_the_readings_of_the_log(recorded):
    """The frames lose, add and exchange nothing: cantools' readings make the same currents."""
    _, log = recorded
    core = settings_of().core()
    pack = ffi.new("pack_t *")
    owners = ffi.new("uint8_t[]", list(range(CELLS)))
    config = {
        "calibration": core.calibration,
        "cells": CELLS,
        "thermistors": CELLS,
        "thermistor_of": owners,
    }
    lib.pack_init(pack, ffi.new("pack_config_t *", config))
    known, told, has_started, charging = {}, set(), False, 0
    for asked, answer in periods_of(log):
        known |= decoded(asked)
        said = decoded(answer)
        has_started = has_started or said["CommandState"] != 0
        if not has_started:
            assert said["CommandCurrent"] == pytest.approx(0.0, abs=1e-9)
            continue
        voltages = ffi.new("float[]", [value(known, f"Cell{i + 1:03d}Voltage") for i in range(5)])
        surfaces = ffi.new(
            "float[]", [value(known, f"Thermistor{i + 1:03d}Temperature") for i in range(5)]
        )
        socs = ffi.new("float[]", [value(known, f"Cell{i + 1:03d}PlugInCharge") for i in range(5)])
        readings = {
            "current_A": value(known, "PackCurrent"),
            "voltage_V": voltages,
            "surface_temperature_K": surfaces,
            "coolant_in_K": value(known, "CoolantInTemperature"),
            "coolant_out_K": value(known, "CoolantOutTemperature"),
            "cooling_power_W": value(known, "CellCoolingPower"),
            "charge": bool(known["Request"]),
            "reference_current_A": value(known, "ReferenceCurrent"),
            "plug_in_soc": socs,
        }
        lib.pack_step(pack, ffi.new("pack_readings_t *", readings))
        # Towards zero by less than a step of 2 mA; 2 % of one are what float32 may miss it by.
        assert pack.command_A - 4.5e-5 <= said["CommandCurrent"] <= pack.command_A + 2e-3
        assert said["CommandState"] == pack.state
        governor = 0 if pack.decision.cell == lib.PACK_NO_CELL else pack.decision.cell + 1
        assert said["GoverningCell"] == governor
        agrees_with_the_core(said, pack)
        told |= set(said)
        charging += said["CommandCurrent"] < -1.0
    assert charging > 4000
    assert told >= {
        "WeakestCell",
        "PackState",
        "LatchedFaults",
        "PresetHash",
        "Cell005StateOfCharge",
    }


def agrees_with_the_core(said, pack):
    """Whatever the ECU says in a period without a fault is what the core has found in it."""
    cells, decision = [pack.cell[i] for i in range(CELLS)], pack.decision.decision
    cores = [cell.estimate.core_temperature_K for cell in cells]
    counted = [cell.soc.soc if pack.soc_known else math.nan for cell in cells]
    governs = pack.decision.cell != lib.PACK_NO_CELL
    weakest = pack.decision.cell if governs else int(np.argmax(cores))
    calibration = pack.calibration
    numbers = {
        "WeakestCoreTemperature": cores[weakest],
        "WeakestStateOfCharge": counted[weakest],
        "LimitCurrent": decision.lower_A,
        "HighestStateOfCharge": max(counted),
        "LowestStateOfCharge": min(counted),
    }
    for i in range(CELLS):
        numbers[f"Cell{i + 1:03d}CoreTemperature"] = cores[i]
        numbers[f"Cell{i + 1:03d}StateOfCharge"] = counted[i]
    codes = {
        "WeakestCell": weakest + 1,
        "WeakestInDomain": cells[weakest].estimate.in_domain,
        "GoverningConstraint": decision.active,
        "Feasible": decision.feasible,
        "PackState": pack.state,
        "FirstFault": lib.FAULT_NONE,
        "FaultyCell": 0,
        "ActiveFaults": 0,
        "LatchedFaults": 0,
        "ModelHash": calibration.model_hash,
        "PresetHash": calibration.preset_hash >> 16,
        "Cells": CELLS,
        "NetworkVersion": int(DATABASE.version),
    }
    for name in codes.keys() & said.keys():
        assert said[name] == codes[name], name
    for name in numbers.keys() & said.keys():
        half_step = 0.51 * signal_of(name).scale
        assert value(said, name) == pytest.approx(numbers[name], abs=half_step, nan_ok=True), name


def test_the_charge_over_the_bus_is_that_of_the_study_s_engine_within_the_frames_steps():
    """`bms pack` hands readings over in C; over the bus they, and the current, have steps."""
    settings = settings_of(16)
    over_bus = charge_pack(settings)
    children = np.random.SeedSequence(entropy=0, spawn_key=(0,)).spawn(3)
    draws, noise, _ = (np.random.Generator(np.random.Philox(child)) for child in children)
    drawn = draw_pack(PRESET, spread_of(settings.spread), 16, draws)
    engine = PackCharge(settings.core(), drawn, settings.around, settings.view, 3600.0)
    engine.fields.off_periods = OFF_PERIODS + 1
    width = 2 * 16 + lib.PACK_SHARED_NORMALS
    currents = []
    while not engine.is_over:
        for row in noise.standard_normal((BLOCK_PERIODS, width)):
            currents.append(engine.fields.current_A)
            engine.advance(row[None, :])
    assert engine.outcome == over_bus.reason == "complete"
    both = min(len(currents), len(over_bus.supplied_A))
    assert abs(engine.fields.time_s - over_bus.charge_periods * 0.1) <= 0.5
    difference_A = np.abs(np.array(currents[:both]) - over_bus.supplied_A[:both])
    assert np.mean(difference_A) < 0.01
    assert engine.peaks() == pytest.approx(over_bus.peaks, rel=1e-3)


def test_equal_seeds_give_equal_logs_and_others_other_ones(tmp_path):
    def log(name, seed):
        with Recorder(tmp_path / name) as recorder:
            charge_pack(settings_of(2, seed=seed, max_time_s=20.0), recorder)
        return (tmp_path / name).read_bytes()

    assert log("a.log", 1) == log("b.log", 1) != log("c.log", 2)


def test_the_allowance_of_the_string_s_sum_knows_the_step_of_its_signal():
    signal = DATABASE.get_message_by_name("PackElectrical").get_signal_by_name("PackVoltage")
    assert signal.scale / 2.0 == PACK_VOLTAGE_STEP_V


def test_equal_cells_stay_equal_and_each_has_its_estimate_on_the_bus(tmp_path):
    path = tmp_path / "can.log"
    with Recorder(path) as recorder:
        charge_pack(settings_of(7, spread=SpreadKind.NONE, max_time_s=60.0), recorder)
    values = decoded([f for f in read_log(path) if 0x290 <= f.frame_id < 0x2B0])
    cores = [value(values, f"Cell{i:03d}CoreTemperature") for i in range(1, 8)]
    socs = [value(values, f"Cell{i:03d}StateOfCharge") for i in range(1, 8)]
    assert max(cores) - min(cores) < 0.5
    assert max(socs) - min(socs) < 0.001
    assert min(socs) > 0.1


def test_a_cell_governs_only_in_periods_in_which_the_ecu_said_so():
    """An ECU that falls silent in mid-charge says nothing any more; what it said last is past."""
    periods = {"now": 0, "heard": 1500}

    def silenced(frames):
        periods["now"] += 1
        return frames if periods["now"] <= periods["heard"] else []

    settings = settings_of(6, answer_timeout_s=0.01)
    silent = charge_pack(settings, sent=silenced)
    assert silent.reason == STOP_SILENT
    assert silent.commands_A[-5:] == [None] * 5
    heard_s = (periods["heard"] - OFF_PERIODS) * PRESET.timing.sampling_period_s
    other = charge_pack(settings_of(6, max_time_s=heard_s))
    assert other.commands_A == silent.commands_A[:-5]
    assert sum(silent.governed.values()) == sum(other.governed.values()) > 0


def test_frames_that_a_bus_hands_back_to_the_plant_are_counted_once(monkeypatch):
    """udp_multicast does so."""
    plain = charge_pack(settings_of(max_time_s=3.0))
    exchange = PackPlantNode.exchange
    monkeypatch.setattr(
        PackPlantNode,
        "exchange",
        lambda node, period, published: [*published, *exchange(node, period, published)],
    )
    echoed = charge_pack(settings_of(max_time_s=3.0))
    assert (echoed.commands_A, echoed.frames) == (plain.commands_A, plain.frames)
