"""`bms monitor` beside a pack: which cells are weakest, how far apart they are, what is wrong."""

from __future__ import annotations

import io
import re
import signal
import subprocess
from contextlib import contextmanager
from functools import cache
from threading import Event, Thread

import pytest
from rich.console import Console

from bms.model.pair import load_pair
from codegen.pack_database import MOST_CELLS
from hil_sim.bus.buses import Frame, open_bus
from hil_sim.monitor.model import Snapshot
from hil_sim.monitor.pack_model import PackModel, PackSnapshot, pack_codecs
from hil_sim.monitor.pack_screen import PackScreen, pack_line
from hil_sim.monitor.presets import preset_finder
from hil_sim.monitor.recognition import BusModel
from hil_sim.nodes.ecu import EcuNode
from hil_sim.pack.charge import charge_pack, charge_pack_elsewhere
from hil_sim.pack.ecu import PackEcu
from hil_sim.pack.settings import PackChargeSettings
from tests.hil_sim.command_line import bms
from tests.hil_sim.slcan_hub import FRAMES, SlcanHub
from tests.hil_sim.terminal import COMMAND, PATIENCE_S, Terminal

PRESET, MODEL = load_pair("paper_calibrated", None)
PAUSE_S = 0.04
PERIOD_S = 0.1


class Kept:
    """A recorder that keeps the frames with their times."""

    def __init__(self):
        self.frames = []

    def record(self, time_s, frames, received):
        self.frames += [(time_s, Frame(i, data)) for i, data in frames]


@cache
def charged(cells, max_time_s=8.0):
    """Frames of a charge, and what the ECU and plant knew at its end."""
    kept = Kept()
    settings = PackChargeSettings(PRESET, MODEL, cells, seed=3, max_time_s=max_time_s)
    return kept.frames, charge_pack(settings, kept)


def known(frames, model=None, age_s=0.0):
    model = PackModel() if model is None else model
    for time_s, frame in frames:
        model.take(time_s, frame)
    return model.snapshot(frames[-1][0] + age_s)


def drawn(snapshot, columns=80, rows=24):
    console = Console(record=True, width=columns, height=rows, file=io.StringIO())
    screen = PackScreen(snapshot, preset_finder(None).find(snapshot.identity), "socketcan:vcan0")
    console.print(screen, height=rows)
    return console.export_text()


def test_a_pack_is_known_by_its_frames_with_every_cell():
    frames, result = charged(16)
    snapshot = known(frames)
    assert [cell.number for cell in snapshot.cells] == list(range(1, 17))
    assert len(snapshot.thermistors_K) == 16
    assert snapshot.name("PackState") in ("Charging", "Derated")
    current_A = snapshot.readings["PackCurrent"].value
    assert current_A == pytest.approx(result.supplied_A[-1], abs=0.03)
    total_V = sum(cell.voltage_V for cell in snapshot.cells)
    assert snapshot.readings["PackVoltage"].value == pytest.approx(total_V, abs=0.1)
    for cell, soc, core_K in zip(snapshot.cells, result.final_socs, result.core_K[-1]):
        assert cell.soc == pytest.approx(soc, abs=0.02)
        assert cell.core_K == pytest.approx(core_K, abs=1.5)
        assert not cell.is_stale
    assert snapshot.foreign.frames == 0
    assert snapshot.identity.preset_hash == PRESET.hash[:4]


def test_the_cells_with_the_least_margin_come_first():
    snapshot = known(charged(16)[0])
    margins = snapshot.nearest(PRESET)
    assert len(margins) == 16
    assert [one.share for one in margins] == sorted(one.share for one in margins)
    least, limits = margins[0], PRESET.limits
    assert least.limit == "voltage"
    idle_V = PRESET.cell.ocv.voltage_V[0]
    left = (limits.max_voltage_V - least.cell.voltage_V) / (limits.max_voltage_V - idle_V)
    assert least.share == pytest.approx(left)
    assert least.cell.voltage_V == max(cell.voltage_V for cell in snapshot.cells)


def test_what_comes_no_more_is_stale_and_what_has_not_come_is_not_there():
    frames, _ = charged(16)
    assert all(cell.is_stale for cell in known(frames, age_s=20.0).cells)
    assert known(frames, age_s=20.0).is_silent
    first = known([one for one in frames if one[0] == 0.0])
    assert [cell.number for cell in first.cells if cell.core_K is None]
    empty = PackModel().snapshot(1.0)
    assert (empty.cells, empty.silence_s, empty.identity) == ((), None, None)
    assert "waiting for frames" in drawn(empty)


def test_a_frame_that_is_not_intact_is_counted_and_not_believed():
    codec = pack_codecs()["PackDiagnostics"]
    good = codec.encode({"PackState": 5, "FirstFault": 5, "FaultyCell": 7, "ActiveFaults": 1 << 5})
    model = PackModel()
    model.take(0.0, Frame(codec.frame_id, good))
    model.take(0.1, Frame(codec.frame_id, bytes([good[0] ^ 1]) + good[1:]))
    model.take(0.2, Frame(0x7F0, b"x"))
    snapshot = model.snapshot(0.2)
    assert (snapshot.refused, snapshot.foreign.frames) == (1, 1)
    assert snapshot.faults("ActiveFaults") == ["VoltageRange"]
    text = drawn(snapshot)
    assert re.search(r" Fault ", text)
    assert "first fault  VoltageRange, cell 7" in text
    assert "foreign frames  1" in text
    assert "bad frames  1" in text


@pytest.mark.parametrize("cells", [1, 16, MOST_CELLS])
@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 60)])
def test_everything_is_on_the_screen_of_any_size(cells, size):
    text = drawn(known(charged(cells, 4.0)[0]), *size)
    lines = text.splitlines()
    assert len(lines) <= size[1]
    assert max(map(len, lines)) <= size[0]
    for pattern in (
        r" (Charging|Derated) +socketcan:vcan0 +lock step",
        rf"{cells} cells, {cells} thermistors  model [0-9a-f]{{8}}  paper_calibrated",
        r"pack +-\d+\.\d{3} A \(limit -23\.000 A\) +\d+\.\d\d V",
        r"command +-\d+\.\d{3} A   admitted by all -\d+\.\d{3} A   governed by",
        r"weakest +cell \d+: core \d+\.\d\d K, state of charge \d+\.\d\d %",
        r"hottest +cell \d+ \d+\.\d\d K",
        r"fullest +cell \d+ \d+\.\d\d %",
        r"spread +voltage \d+\.\d mV   core \d+\.\d\d K   state of charge \d+\.\d\d %",
        r"cell +nearest to +left",
        r"first fault  none",
        r"latched  none",
    ):
        assert re.search(pattern, text), pattern


def test_the_governing_cell_and_its_constraint_are_named():
    codecs = pack_codecs()
    model = PackModel()
    values = {"GoverningCell": 12, "GoverningConstraint": 3, "Feasible": 1, "LimitCurrent": -9.5}
    model.take(0.0, Frame(codecs["PackDecision"].frame_id, codecs["PackDecision"].encode(values)))
    text = drawn(model.snapshot(0.0))
    assert "admitted by all -9.500 A   governed by cell 12, core" in text


def test_a_bus_is_a_cells_until_a_pack_is_heard_alone_or_is_asked_for(database):
    frames, _ = charged(1, 4.0)
    model = BusModel()
    assert isinstance(model.snapshot(0.0), Snapshot)
    assert isinstance(known(frames, model), PackSnapshot)
    cell = database["CellThermal"]
    model.take(9.0, Frame(cell.frame_id, cell.encode({"SurfaceTemperature": 300.0})))
    assert isinstance(model.snapshot(9.0), Snapshot)
    asked = BusModel(4)
    assert isinstance(asked.snapshot(0.0), PackSnapshot)
    assert "--cells 4 is not what the bus says: 1 cells" in known(frames, asked).remark
    assert "--cells 4 is not" in drawn(asked.snapshot(9.0))


def test_another_version_of_the_database_is_told():
    codec = pack_codecs()["PackIdentity"]
    values = {"ModelHash": 1, "PresetHash": 2, "Cells": 3, "NetworkVersion": 99}
    model = PackModel()
    model.take(0.0, Frame(codec.frame_id, codec.encode(values)))
    snapshot = model.snapshot(0.0)
    assert snapshot.identity is None
    assert "the ECU speaks version 99 of the pack's database" in snapshot.remark


def test_the_line_for_pipes_has_state_governor_margins_spread_and_faults():
    snapshot = known(charged(16)[0])
    line = pack_line(3.0, snapshot, preset_finder(None).find(snapshot.identity))
    assert re.match(
        r"3\.0 s  (Charging|Derated); 16 cells -\d+\.\d{3} A; \d+\.\d\d V; command", line
    )
    assert re.search(r"least margins (cell \d+ \d+\.\d % of voltage(, )?){3};", line)
    assert "spread voltage" in line
    assert line.endswith("active none; latched none; foreign 0")
    assert "\n" not in line


@contextmanager
def charging(bus, cells):
    """Plant and ECU of a pack in lock step, slow enough to be looked at on any machine."""
    stop = Event()
    settings = PackChargeSettings(
        PRESET, MODEL, cells, bus=bus, max_time_s=5.0, answer_timeout_s=PATIENCE_S
    )

    def run_ecu():
        with open_bus(bus) as connection:
            node = EcuNode(connection, PackEcu(settings))
            while not stop.wait(PAUSE_S):
                node.answer(0.1)

    ecu = Thread(target=run_ecu, daemon=True)
    plant = Thread(target=charge_pack_elsewhere, args=(settings,), daemon=True)
    ecu.start()
    plant.start()
    try:
        yield
    finally:
        plant.join()
        stop.set()
        ecu.join()


def test_on_a_terminal_it_recognises_a_pack_and_follows_it_without_a_frame_of_its_own():
    with SlcanHub() as hub:
        terminal = Terminal("--bus", hub.bus)
        try:
            terminal.wait_for("waiting for frames")
            (told,) = hub.commands
            with charging(hub.bus, 4):
                terminal.wait_for(
                    r"^ Charging +slcan:socket://127.0.0.1:\d+ +lock step",
                    r"4 cells, 4 thermistors",
                    r"governed by",
                    r"nearest to",
                    r"latched  none",
                )
            terminal.wait_for(r"^ Charging +stale", "silent for")
            terminal.press(b"q")
            terminal.wait_for(r"watched slcan:\S+ for \d+\.\d s: \d+ frames")
            assert terminal.process.wait(PATIENCE_S) == 0
            assert told == [b"C", b"S6", b"L", b"C"]
        finally:
            terminal.close()


def test_in_a_pipe_a_packs_line_comes_each_second():
    with SlcanHub() as hub:
        process = subprocess.Popen(
            [*COMMAND, "--bus", hub.bus, "--cells", "4"], stdout=subprocess.PIPE, text=True
        )
        first = process.stdout.readline()
        with charging(hub.bus, 4):
            pass
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=PATIENCE_S)
        assert first.startswith("0.0 s  n/a; 4 cells n/a")
        assert process.returncode == 0
        assert re.search(r"s  Charging; 4 cells -\d+\.\d{3} A", out)
        assert not [command for command in hub.commands[0] if command[:1] in FRAMES]


def test_a_number_of_cells_that_no_pack_has_is_refused():
    result = bms("monitor", "--bus", "slcan:socket://127.0.0.1:9", "--cells", "193")
    assert result.returncode == 2
    assert "--cells" in result.stderr
    assert len(result.stderr.splitlines()) == 1
