"""The screen shows everything at any size from 80 by 24 on, and says what is stale."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil_sim.bus.buses import Frame
from hil_sim.bus.e2e import Sender
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.monitor import wording
from hil_sim.monitor.bar import Bar
from hil_sim.monitor.model import SystemModel
from hil_sim.monitor.presets import preset_finder
from hil_sim.monitor.status_line import status_line
from tests.hil_sim.golden.record import FOLDER
from tests.hil_sim.monitor_picture import PICTURE, drawn, picture, snapshot_of

SELDOM = ("ChargeMode", "BootRefusal")  # neither is sent in a charge of today's plant
SIZES = [(80, 24), (120, 40), (200, 24), (80, 60)]


def text_of(snapshot, columns, rows, preset=None):
    lines = drawn(snapshot, columns, rows, preset).export_text().splitlines()
    assert len(lines) == rows
    assert max(map(len, lines)) <= columns
    return "\n".join(lines)


@pytest.fixture(scope="module")
def charging():
    return snapshot_of(FOLDER / "hot_derating.log.gz", 25.0)


@pytest.fixture(scope="module")
def faulty():
    return snapshot_of(FOLDER / "message_loss.log.gz", 16.5)


@pytest.mark.parametrize("size", SIZES)
def test_everything_is_on_the_screen(charging, database, size):
    text = text_of(charging, *size)
    assert re.search(r" Derated +socketcan:vcan0 +lock step", text)
    for pattern in (
        r"firmware \d+ +model [0-9a-f]{8} +paper_calibrated \([0-9a-f]{4}\)",
        r"core estimate +\d+\.\d\d ± \d\.\d\d K +━+.*┃ +limit 323\.00 K",
        r"surface +\d+\.\d\d K +━+.*┃ +limit 323\.00 K",
        r"voltage +\d\.\d{4} V +━+.*┃ +limit 3\.6000 V",
        r"state of charge +\d+\.\d\d % +━+.*┃ +limit 100\.00 %",
        r"current +-\d+\.\d{3} A +━+.*┃ +limit -23\.000 A",
        r"command +-\d+\.\d{3} A +admitted -\d+\.\d{3} … -?\d\.\d{3} A +constraint core",
        r"margins +voltage \S+ V +SoC \S+ /s +core \S+ K/s +surface \S+ K/s²",
        r"coolant +\d+\.\d\d K +cooling power \d\.\d{3} W",
        "foreign frames none",
        "first fault +none",
        "active +none",
        "latched +none",
        "q quits",
    ):
        assert re.search(pattern, text), pattern
    rates = {"Identity": "1.0", "NetworkDiagnostics": "2.0", "Diagnostics2": "2.0", "Plan": "2.0"}
    rates["Start"] = "1.0"
    for codec in database.values():
        if codec.name in SELDOM or (codec.name in ("Plan", "Start") and size[1] <= 24):
            assert codec.name not in text
            continue
        rate = rates.get(codec.name, "10.0")
        assert re.search(rf"{codec.frame_id:03X} {codec.name} +{rate} +0\.\d\d s +0\b", text)
    for identifier in range(0x100, 0x104):
        assert re.search(rf"{identifier:03X} Valid( +0){{5}}", text)


@pytest.mark.parametrize("size", SIZES)
def test_faults_and_counts_are_named(faulty, size):
    text = text_of(faulty, *size)
    assert text.startswith(" Fault ")
    assert re.search("first fault +ElectricalMissing", text)
    assert re.search("latched +ElectricalMissing", text)
    assert re.search("active +.*ElectricalMissing", text)
    assert re.search("100 Invalid( +0){5}", text)
    assert re.search("101 Valid +0 +0 +0 +1 +0", text)
    assert re.search(r"100 CellElectrical +stale +2\.60 s", text)
    assert re.search(r"current +-?\d+\.\d+ A +stale +limit", text)


@pytest.mark.parametrize("size", SIZES)
def test_the_four_faults_of_a_plant_that_is_gone_are_all_on_the_screen(database, size):
    model = SystemModel(database)
    values = {"DiagnosticState": 5, "FirstFault": 0, "ActiveFaults": 15, "LatchedFaults": 15}
    model.take(0.0, Sender(database["Diagnostics"]).frame(values))
    text = text_of(model.snapshot(0.0), *size)
    assert re.search(r"active \(4\) +ElectricalMissing", text)
    assert re.search(r"latched \(4\) +ElectricalMissing", text)
    for name in ("ElectricalMissing", "ThermalMissing", "CoolantMissing", "RequestMissing"):
        assert text.count(name) == (3 if name == "ElectricalMissing" else 2)


@pytest.mark.parametrize("size", SIZES)
def test_what_came_and_comes_no_more_is_stale(size):
    text = text_of(snapshot_of(FOLDER / "hot_derating.log.gz", 25.0, age_s=200.0), *size)
    assert re.search(r" Derated +stale +socketcan:vcan0 +silent for 3 min", text)
    assert text.count("stale") == 1 + 5 + 3 + 13 + 2 * (size[1] > 24) + 4 + 3
    assert "━" not in text


@pytest.mark.parametrize("size", [size for size in SIZES if size[1] > 24])
def test_what_seldom_comes_has_its_row_when_it_has_come(database, size):
    model = SystemModel(database)
    for name in SELDOM:
        model.take(0.0, Sender(database[name]).frame({}))
    text = text_of(model.snapshot(0.0), *size)
    for name in SELDOM:
        assert f"{database[name].frame_id:03X} {name}" in text


@pytest.mark.parametrize("size", SIZES)
def test_what_has_not_come_is_not_available(database, size):
    text = text_of(SystemModel(database).snapshot(0.0), *size)
    assert "waiting for frames" in text
    assert "no Identity yet: limits unknown" in text
    assert "stale" not in text
    assert "None" not in text
    for label in ("core estimate", "surface", "voltage", "state of charge", "current"):
        assert re.search(rf"{label} +n/a +limit n/a", text)


@pytest.mark.parametrize("size", SIZES)
def test_a_preset_that_is_not_the_one_of_the_ecu_is_said_and_that_of_the_ecu_is_shown(
    charging, size
):
    text = text_of(charging, *size, preset="lin2014")
    assert re.search(r"^--preset lin2014 \([0-9a-f]{4}\) is not the ECU's *$", text, re.M)
    assert re.search(r"paper_calibrated \([0-9a-f]{4}\)", text)
    assert "limit 323.00 K" in text
    assert "186 NetworkDiagnostics" in text


def test_foreign_frames_are_counted_on_the_screen(database):
    model = SystemModel(database)
    for number in range(300):
        model.take(0.01 * number, Frame(0x300 + number % 7, b""))
        model.take(0.01 * number, ForeignFrame.EXTENDED)
    text = " ".join(text_of(model.snapshot(3.0), 80, 24).split())
    assert "foreign frames 600" in text
    assert "7 ids" in text


def test_the_line_says_the_same_without_a_terminal(charging, faulty):
    in_force = preset_finder(None).find(charging.identity)
    line = status_line(12.34, charging, in_force)
    assert re.match(
        r"12\.3 s  Derated; core estimate \d+\.\d+ ± 0\.\d+ K \(limit 323\.00 K\); ", line
    )
    assert "constraint core; active none; latched none; foreign 0" in line
    assert "stale" not in line and "\n" not in line
    assert "A (limit -23.000 A) stale; command 0.000 A;" in status_line(0.0, faulty, in_force)


@given(value=st.floats(-100.0, 200.0), bound=st.floats(0.0, 50.0), width=st.integers(8, 200))
def test_a_bar_has_its_width_one_limit_and_grows_with_the_value(value, bound, width):
    bar = Bar(value, idle=0.0, limit=100.0, bound=bound)
    cells = bar.cells(width)
    assert len(cells) == width
    assert cells.count("┃") == 1
    assert cells.index("┃") == Bar(0.0, 0.0, 100.0).cells(width).index("┃")
    more = Bar(value + 30.0, idle=0.0, limit=100.0, bound=bound).cells(width)
    assert more.count("━") >= cells.count("━")


@pytest.mark.parametrize(
    ("value", "color"),
    [(0.0, "green"), (97.9, "green"), (98.1, "yellow"), (100.0, "yellow"), (100.1, "red")],
)
def test_a_bar_is_yellow_at_its_limit_and_red_beyond(value, color):
    assert Bar(value, idle=0.0, limit=100.0).color == color
    assert Bar(-value, idle=0.0, limit=-100.0).color == color


@pytest.mark.parametrize(
    ("time_s", "text"),
    [
        (0.0, "0.00 s"),
        (9.994, "9.99 s"),
        (9.996, "10 s"),
        (99.4, "99 s"),
        (120.0, "2 min"),
        (7200.0, "2 h"),
    ],
)
def test_a_duration_is_as_fine_as_it_matters(time_s, text):
    assert wording.duration(time_s) == text


def test_the_picture_in_the_documents_is_this_screen():
    assert PICTURE.read_text(encoding="utf-8") == picture(), (
        "run: python -m tests.hil_sim.monitor_picture"
    )
