"""The file of faults: what it may say, how it is refused, and what a run tells of it."""

from __future__ import annotations

import json
from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.errors import InputError
from hil_sim.faults import load_faults, parse_fault
from hil_sim.faults.plan import KINDS
from tests.hil_sim.command_line import bms

WHEN = "from_s = 1.5\n"
EXAMPLES = {
    "message-lost": 'message = "Coolant"',
    "message-delayed": 'message = "Coolant"\ndelay_periods = 2',
    "message-repeated": 'message = "Coolant"',
    "message-frozen": 'message = "ChargeCommand"',
    "message-reordered": 'message = "Coolant"',
    "byte-corrupted": 'message = "Coolant"\nbyte = 3\nmask = 0x80',
    "message-wrong-id": 'message = "Coolant"\nframe_id = 0x7FF',
    "message-wrong-length": 'message = "Coolant"\nlength = 3',
    "message-masqueraded": 'message = "Coolant"',
    "message-contested": 'message = "Coolant"\nsignal = "CoolingPower"\nvalue = 3.0',
    "bus-off": "for_s = 2",
    "bus-flood": 'position = "after"',
    "sensor-stuck": 'sensor = "voltage_V"',
    "sensor-drifting": 'sensor = "voltage_V"\nrate_per_s = -0.1',
    "sensor-biased": 'sensor = "voltage_V"\noffset = 0.1',
    "sensor-out-of-range": 'sensor = "voltage_V"\nvalue = 9',
    "sensor-jumping": 'sensor = "voltage_V"\namplitude = 0.1',
    "sensor-unit-swapped": 'sensor = "voltage_V"',
    "sensor-not-available": 'sensor = "voltage_V"',
    "surface-above-core": "excess_K = 5.0",
    "charger-stuck": "for_periods = 10",
    "charger-gain": "factor = 1.1",
    "pump-failed": 'reported = "healthy"',
    "ecu-restarted": "for_periods = 1",
    "clock-jitter": "late_ms = 20",
}


def table(kind, rest="", when=WHEN):
    return f'[[fault]]\nkind = "{kind}"\n{when}{rest}\n'


@pytest.fixture
def path(tmp_path):
    return tmp_path / "faults.toml"


def test_every_kind_has_an_example_here_and_all_fit_into_one_file(path):
    path.write_text("".join(table(kind, rest) for kind, rest in EXAMPLES.items()))
    loaded = load_faults(path)
    assert [fault.kind for fault in loaded] == list(EXAMPLES)
    assert {type(fault) for fault in loaded} == set(KINDS)
    assert all(fault.where for fault in loaded)


@pytest.mark.parametrize(
    ("when", "first", "last"),
    [
        ("from_s = 1.5\n", 15, None),
        ("from_s = 1.51\nfor_s = 0.3\n", 16, 18),
        ("from_period = 7\nfor_periods = 1\n", 7, 7),
        ("from_s = 0\nfor_s = 0.01\n", 0, 0),
        ("from_period = 7\nfor_s = 0.3\n", 7, 9),
    ],
)
def test_times_and_periods_say_the_same(path, when, first, last):
    path.write_text(table("bus-off", when=when))
    window = load_faults(path)[0].window(0.1)
    assert window[0] == first
    assert first - 1 not in window
    if last is None:
        assert 10**9 in window
    else:
        assert window[-1] == last


REFUSED = [
    ("", "[[fault]]"),
    ("fault = []", "[[fault]]"),
    ("fault = 7", "fault"),
    ("[[fault]\n", "TOML"),
    ("[[fault]]\nfrom_s = 1\n", "message-lost"),
    (table("unheard-of"), "sensor-stuck"),
    (table("bus-off", when=""), "from_period"),
    (table("bus-off", when="from_s = 1\nfrom_period = 1\n"), "from_period"),
    (table("bus-off", "for_s = 1\nfor_periods = 1"), "for_periods"),
    (table("bus-off", when="from_s = -1\n"), "from_s"),
    (table("bus-off", when="from_s = nan\n"), "from_s"),
    (table("bus-off", when='from_s = "soon"\n'), "from_s"),
    (table("bus-off", when="from_period = 1.5\n"), "from_period"),
    (table("bus-off", "for_s = 0"), "for_s"),
    (table("bus-off", "for_periods = 0"), "for_periods"),
    (table("bus-off", "colour = 7"), "colour"),
    (table("message-lost"), "message"),
    (table("message-lost", 'message = "SYNC"'), "CellElectrical"),
    (table("byte-corrupted", 'message = "Coolant"\nbyte = 4'), "0 to 3"),
    (table("byte-corrupted", 'message = "Coolant"\nbyte = 0\nmask = 0'), "mask"),
    (table("byte-corrupted", 'message = "Coolant"\nbyte = 0\nmask = 256'), "mask"),
    (table("message-wrong-id", 'message = "Coolant"\nframe_id = 0x102'), "0x102"),
    (table("message-wrong-id", 'message = "Coolant"\nframe_id = 0x080'), "SYNC"),
    (table("message-wrong-id", 'message = "Coolant"\nframe_id = 0x800'), "frame_id"),
    (table("message-wrong-length", 'message = "Coolant"\nlength = 4'), "length"),
    (table("message-wrong-length", 'message = "Coolant"\nlength = 9'), "length"),
    (table("message-masqueraded", 'message = "Identity"'), "protected"),
    (
        table("message-contested", 'message = "Coolant"\nsignal = "Voltage"\nvalue = 3.0'),
        "CoolingPower",
    ),
    (
        table("message-contested", 'message = "Identity"\nsignal = "ModelHash"\nvalue = 3.0'),
        "protected",
    ),
    (table("message-delayed", 'message = "Coolant"\ndelay_periods = 0'), "delay_periods"),
    (table("sensor-stuck", 'sensor = "core_temperature_K"'), "voltage_V"),
    (table("sensor-drifting", 'sensor = "voltage_V"\nrate_per_s = inf'), "rate_per_s"),
    (table("surface-above-core", 'excess_K = 1.0\nsensor = "voltage_V"'), "sensor"),
    (table("charger-gain", "factor = -1"), "factor"),
    (table("pump-failed", 'reported = "maybe"'), "healthy"),
    (table("clock-jitter", "late_ms = 0"), "late_ms"),
]


@pytest.mark.parametrize(("text", "said"), REFUSED)
def test_what_is_wrong_is_one_line_with_file_and_key(path, text, said):
    path.write_text(text)
    with pytest.raises(InputError) as error:
        load_faults(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert said in message
    assert "\n" not in message


def test_the_second_fault_is_told_from_the_first(path):
    path.write_text(table("bus-off") + table("bus-off", "colour = 7"))
    with pytest.raises(InputError, match=r"fault\.1\."):
        load_faults(path)


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(), inner, max_size=2),
    max_leaves=3,
)
KEYS = sorted({item.name for kind in KINDS for item in fields(kind)})


@given(
    kind=st.sampled_from(sorted(EXAMPLES)),
    content=st.dictionaries(st.sampled_from(KEYS), ANYTHING, max_size=5),
)
def test_no_content_does_worse_than_being_refused(kind, content):
    try:
        fault = parse_fault({"kind": kind, **content}, "here")
    except InputError as error:
        assert str(error).startswith("here: ")
    else:
        assert len(fault.window(0.1)[:2]) >= 1


def test_a_run_reports_what_was_injected_and_when(path, tmp_path):
    path.write_text(
        table("message-lost", 'message = "CellThermal"\nfor_periods = 2')
        + table("sensor-out-of-range", 'sensor = "voltage_V"\nvalue = 0.0', "from_s = 3\n")
        + table("bus-off", when="from_s = 50\n")
    )
    done = bms("sil", "--faults", path, "--max-time-s", 10, "--out", tmp_path / "run", "--json")
    summary = json.loads(done.stdout)
    assert summary == json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["faults"] == [
        {"kind": "message-lost", "where": "CellThermal", "begin_s": 1.5, "end_s": 1.7},
        {"kind": "sensor-out-of-range", "where": "voltage_V", "begin_s": 3.0, "end_s": None},
    ]
    assert done.returncode == 1
    assert (summary["stop_reason"], summary["first_fault"]) == ("fault", 5)
    page = (tmp_path / "run" / "report.html").read_text()
    assert "Faults that were injected" in page
    assert "message-lost" in page
    log = (tmp_path / "run" / "can.log").read_text()
    sync, thermal = log.count(" 080#"), log.count(" 101#")
    assert thermal == sync - 2


@pytest.mark.parametrize(
    ("command", "text", "said"),
    [
        (("sil",), table("bus-off", "colour = 7"), "colour"),
        (("sil",), None, "no such file"),
        (("sil",), table("clock-jitter", "late_ms = 5"), "--realtime"),
        (("plant", "--bus", "udp_multicast:239.1.1.1"), table("ecu-restarted"), "bms sil"),
        (("plant", "--bus", "udp_multicast:239.1.1.1"), table("bus-off", "x = 1"), "x"),
    ],
)
def test_a_file_that_cannot_be_used_is_one_line_and_exit_code_2(command, text, said, path):
    if text is not None:
        path.write_text(text)
    done = bms(*command, "--faults", path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert said in done.stderr
