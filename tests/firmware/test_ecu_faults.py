"""Every fault of the ECU: 0 A within its deadline, latched, named, and released by request off."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import pytest

from bms.firmware._firmware import ffi, lib
from tests.firmware.bench import DATABASE, HEALTHY, MEASURED, Bench, frame

NOT_AVAILABLE = {
    "Current": 1048.574,
    "Voltage": 6.5535,
    "SurfaceTemperature": 527.675,
    "CoolantTemperature": 527.675,
    "CoolingPower": 45.535,
    "ReferenceCurrent": 1048.574,
    "PlugInStateOfCharge": 1.3107,
}


@dataclass(frozen=True)
class Case:
    """What happens to the inputs from one period on, and how many periods 0 A may take."""

    name: str
    fault: int
    deadline: int
    changes: dict[str, float] = field(default_factory=dict)
    drop: tuple[str, ...] = ()


CASES = [
    Case("electrical message lost", 0, 1, drop=("CellElectrical",)),
    Case("thermal message lost", 1, 1, drop=("CellThermal",)),
    Case("coolant message lost", 2, 1, drop=("Coolant",)),
    Case("request message lost", 3, 1, drop=("ChargeRequest",)),
    Case("current out of range", 4, 1, {"Current": -40.0}),
    Case("current not available", 4, 1, {"Current": NOT_AVAILABLE["Current"]}),
    Case("voltage too low", 5, 1, {"Voltage": 0.0}),
    Case("voltage not available", 5, 1, {"Voltage": NOT_AVAILABLE["Voltage"]}),
    Case("surface sensor open", 6, 1, {"SurfaceTemperature": 200.0}),
    Case(
        "surface not available", 6, 1, {"SurfaceTemperature": NOT_AVAILABLE["SurfaceTemperature"]}
    ),
    Case("coolant sensor open", 7, 1, {"CoolantTemperature": 200.0}),
    Case(
        "coolant not available", 7, 1, {"CoolantTemperature": NOT_AVAILABLE["CoolantTemperature"]}
    ),
    Case("cooling power negative", 8, 1, {"CoolingPower": -5.0}),
    Case("cooling power not available", 8, 1, {"CoolingPower": NOT_AVAILABLE["CoolingPower"]}),
    Case("request unknown", 9, 1, {"Request": 7}),
    Case("reference not available", 9, 1, {"ReferenceCurrent": NOT_AVAILABLE["ReferenceCurrent"]}),
    Case("reference discharges", 9, 1, {"ReferenceCurrent": 1.0}),
    Case("start not available", 9, 1, {"PlugInStateOfCharge": 1.3107}),
    Case("coolant colder than trained", 10, 1, {"CoolantTemperature": 262.0}),
    Case("combination never seen", 10, 1, {"CoolantTemperature": 321.0}),
    Case("charger ignores the command", 11, 3, {"Current": -20.0}),
    Case("voltage against the model", 12, 5, {"Voltage": 3.0}),
    Case("voltage over the limit", 13, 1, {"Voltage": 3.7}),
    Case("core too hot", 14, 1, {"SurfaceTemperature": 324.5, "CoolantTemperature": 300.0}),
    Case("surface too hot", 15, 1, {"SurfaceTemperature": 325.5, "CoolantTemperature": 323.0}),
    Case("surface colder than the heat allows", 19, 1, {"SurfaceTemperature": 290.0}),
]


def limit_periods(fault: int) -> int:
    return int(lib.host_fault_policies()[fault].debounce_periods)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_fault_stops_the_charge_in_time_and_stays_until_request_off(case: Case) -> None:
    bench = Bench()
    bench.start()
    assert bench.command_A < 0
    for number in range(1, limit_periods(case.fault) + 1):
        bench.follow_command = False
        bench.period(drop=case.drop, **case.changes)
        if number >= case.deadline:
            assert bench.command_A == 0.0, f"period {number}"
    assert bench.state == "Fault"
    assert case.fault in bench.latched()
    assert bench.answer["FirstFault"] in bench.latched()

    bench.values = {**HEALTHY, "Request": 1}
    for _ in range(10):
        bench.period()
        assert (bench.state, bench.command_A) == ("Fault", 0.0)
    bench.period(Request=0)
    assert (bench.state, bench.latched()) == ("Standby", set())
    bench.follow_command = True
    bench.period(Request=1)
    assert bench.state == "Charging"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_symptom_of_one_period_is_forgiven(case: Case) -> None:
    bench = Bench()
    bench.start()
    before = dict(bench.values)
    bench.follow_command = False
    bench.period(drop=case.drop, **case.changes)
    if case.deadline == 1:
        assert bench.command_A == 0.0
    bench.values = before
    bench.follow_command = True
    bench.period()
    assert bench.state in ("Charging", "Derated")
    assert bench.latched() == set()


@pytest.mark.parametrize(
    "case", [case for case in CASES if "not available" in case.name], ids=lambda case: case.name
)
def test_a_reading_that_is_not_available_is_named_and_not_the_decision_it_spoils(
    case: Case,
) -> None:
    bench = Bench()
    bench.start()
    bench.follow_command = False
    for _ in range(limit_periods(case.fault)):
        bench.period(**case.changes)
    assert bench.answer["FirstFault"] == case.fault


def corrupted(data: bytes, byte: int, mask: int) -> bytes:
    changed = bytearray(data)
    changed[byte] ^= mask
    return bytes(changed)


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("mask", [0x01, 0x80, 0xFF])
def test_a_corrupted_byte_anywhere_is_noticed_in_the_same_period(name: str, mask: int) -> None:
    length = DATABASE.get_message_by_name(name).length
    for byte in range(length):
        bench = Bench()
        bench.start()
        good = frame(name, bench.counters[name], bench.values)
        bench.period(replace={name: [(good[0], corrupted(good[1], byte, mask))]})
        assert bench.command_A == 0.0, f"byte {byte}"
        assert int(bench.answer["ActiveFaults"]) >> 16 & 1


@pytest.mark.parametrize("name", MEASURED)
def test_a_masquerader_with_frozen_counter_and_valid_crc_counts_as_silence(name: str) -> None:
    bench = Bench()
    bench.start()
    frozen = frame(name, bench.counters[name] - 1, bench.values)
    for _ in range(3):
        bench.period(replace={name: [frozen]})
        assert bench.command_A == 0.0
    assert bench.state == "Fault"


@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("length", [0, 1, 2, -1, 8])
def test_a_wrong_length_is_refused(name: str, length: int) -> None:
    bench = Bench()
    bench.start()
    frame_id, data = frame(name, bench.counters[name], bench.values)
    wrong = data[:-1] if length == -1 else (data + bytes(8))[:length]
    bench.period(replace={name: [(frame_id, wrong)]})
    assert bench.command_A == 0.0


def test_reordered_frames_of_one_message_do_not_pass() -> None:
    bench = Bench()
    bench.start()
    name = "CellThermal"
    counter = bench.counters[name]
    old = frame(name, counter - 2, {**bench.values, "SurfaceTemperature": 290.0})
    bench.period(replace={name: [old]})
    assert bench.command_A == 0.0


def test_foreign_frames_change_nothing() -> None:
    plain, crowded = Bench(), Bench()
    for period in range(40):
        for foreign in (0x000, 0x080, 0x0FF, 0x105, 0x188, 0x7FF, 0x1FFFFFFF, 0x180):
            crowded.ecu.receive(foreign, bytes(period % 9))
        assert plain.period(Request=period > 3) == crowded.period(Request=period > 3)


def test_a_calibration_that_the_firmware_refuses_is_a_fault_for_good() -> None:
    bench = Bench()
    state = ffi.new("bms_t *")
    bad = ffi.new("bms_calibration_t *", {"layout": 0})
    for config in (
        ffi.NULL,
        ffi.new("bms_config_t *"),
        ffi.new("bms_config_t *", {"calibration": bad}),
    ):
        lib.bms_init(state, config)
        bench.ecu._state = state
        for _ in range(3):
            bench.period(Request=0)
            assert (bench.state, bench.command_A, bench.latched()) == ("Fault", 0.0, {18})


@pytest.mark.slow
def test_no_current_while_a_fault_is_latched_whatever_other_symptom_comes() -> None:
    one_each = list({case.fault: case for case in CASES}.values())
    for first, second in combinations(one_each, 2):
        bench = Bench()
        bench.start()
        bench.follow_command = False
        for _ in range(5):
            bench.period(drop=first.drop, **first.changes)
        bench.values = {**HEALTHY, "Request": 1}
        bench.period(drop=second.drop, **second.changes)
        assert bench.command_A == 0.0, (first.name, second.name)
        assert {first.fault} <= bench.latched()


def test_signals_never_carry_numbers_that_are_not_known() -> None:
    bench = Bench()
    answer: dict[str, Any] = bench.period(drop=MEASURED)
    assert answer["StateOfCharge"] == pytest.approx(NOT_AVAILABLE["PlugInStateOfCharge"])
    assert answer["CoreTemperature"] == pytest.approx(527.675)
    assert answer["LowerCurrent"] == pytest.approx(NOT_AVAILABLE["Current"])
    assert answer["CommandCurrent"] == 0.0


def test_policy_has_a_row_for_every_fault() -> None:
    rows = lib.host_fault_policies()
    for fault in range(lib.FAULT_COUNT):
        assert 1 <= rows[fault].debounce_periods <= 5, fault
    covered = {case.fault for case in CASES} | {16, 17, 18, 20}
    assert covered == set(range(lib.FAULT_COUNT))


def test_an_invalid_decision_while_charging_is_a_fault() -> None:
    """No frame can bring the counter to NaN, so memory is damaged by hand."""
    bench = Bench()
    bench.start()
    bench.ecu._state.soc.measured.soc = math.nan
    for _ in range(2):
        bench.period()
        assert bench.command_A == 0.0
    assert 17 in bench.latched()
