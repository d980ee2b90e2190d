"""Rules of the core that charges and their frames seldom meet, each from both sides."""

from __future__ import annotations

import math
import zlib
from typing import Any

import pytest

from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from tests.firmware.bench import HEALTHY, RECEIVED, Bench, frame
from tests.firmware.test_e2e import check, counts, protect

OFF, CHARGE = 0, 1
FASTEST, BY_TIME, FIXED = 0, 1, 2
MOST_SOC = 0.8
VALID, INVALID = 2, 3


@pytest.mark.parametrize(
    ("changes", "valid"),
    [
        ({}, True),
        ({"plug_in_soc": 0.0}, True),
        ({"plug_in_soc": -1e-6}, False),
        ({"plug_in_soc": MOST_SOC}, True),
        ({"plug_in_soc": MOST_SOC + 1e-6}, False),
        ({"plug_in_soc": math.nan}, False),
        ({"reference_current_A": 0.0}, True),
        ({"reference_current_A": 1e-6}, False),
        ({"reference_current_A": math.nan}, False),
        ({"request": 2}, False),
        ({"request": OFF, "plug_in_soc": math.nan, "mode": 9}, True),
        ({"mode": FIXED}, True),
        ({"mode": BY_TIME, "time_to_full_s": 0.0}, True),
        ({"mode": BY_TIME, "time_to_full_s": math.nan}, False),
        ({"mode": 3}, False),
    ],
)
def test_a_request_is_valid_where_all_that_it_needs_is(
    changes: dict[str, float], valid: bool
) -> None:
    asked = {"request": CHARGE, "plug_in_soc": 0.5, "reference_current_A": -1.0, "mode": FASTEST}
    message = ffi.new("codec_measurement_t *", {**asked, **changes})
    assert lib.request_is_valid(message, True, MOST_SOC) is valid
    if changes.get("mode") == 3:
        assert lib.request_is_valid(message, False, MOST_SOC), "nobody asked for a mode"


@pytest.mark.parametrize("length", [0, 1])
def test_a_frame_without_room_for_its_protection_is_of_wrong_length(length: int) -> None:
    receiver = ffi.new("e2e_receiver_t *")
    assert lib.e2e_check(receiver, bytes(8), length, length, bytes(16), 3) == 1
    assert counts(receiver)["wrong_length"] == 1


def test_a_sender_is_followed_anew_only_where_the_next_frame_continues() -> None:
    receiver, ids = ffi.new("e2e_receiver_t *"), bytes(16)
    ok, wrong_sequence, reordered = 0, 4, 5
    assert check(receiver, protect(0, ids)) == ok
    assert check(receiver, protect(6, ids)) == wrong_sequence
    assert check(receiver, protect(9, ids)) == wrong_sequence, "6 would be followed by 7"
    assert check(receiver, protect(14, ids)) == reordered
    assert check(receiver, protect(8, ids)) == wrong_sequence
    assert check(receiver, protect(9, ids)) == ok


@pytest.mark.parametrize(("min_good", "state"), [(5, VALID), (6, INVALID)])
def test_a_message_that_needs_more_good_periods_than_are_judged_is_never_valid(
    min_good: int, state: int
) -> None:
    limits = {"min_good": min_good, "max_bad": 0}
    policy = {"max_delta_counter": 3, "window_periods": 5}
    policy |= {"init": limits, "valid": limits, "invalid": limits}
    receiver = ffi.new("e2e_receiver_t *", {"state": VALID, "good_periods": 31, "is_good": True})
    verdict = lib.e2e_supervise(receiver, ffi.new("e2e_policy_t *", policy))
    assert (receiver.state, verdict.is_usable) == (state, state == VALID)


def test_more_frames_than_a_period_can_have_do_not_overflow_their_count() -> None:
    network, taken = ffi.new("network_t *"), ffi.new("codec_measurement_t *")
    measured = []
    for counter in range(400):
        frame_id, data = frame("CellElectrical", counter, {"Voltage": 3.3})
        lib.network_receive(network, ffi.new("can_frame_t *", (frame_id, len(data), data)), taken)
        measured.append(network.measured_periods)
    assert measured[:2] == [0, 1], "the first one sets the counter"
    assert measured[252:258] == [252, 253, 254, 255, 255, 255]
    assert set(measured[258:]) == {255}


@pytest.mark.parametrize(("index", "state"), [(i, s) for i in range(5) for s in (0, 1, 3)])
def test_every_message_but_the_optional_one_has_to_be_valid(index: int, state: int) -> None:
    network = ffi.new("network_t *")
    for receiver in network.receivers:
        receiver.state = VALID
    assert lib.network_is_valid(network)
    network.receivers[index].state = state
    assert lib.network_is_valid(network) is (RECEIVED[index] == "ChargeMode")


def test_content_of_a_message_that_is_none_is_not_taken() -> None:
    taken = ffi.new("codec_measurement_t *", {"voltage_V": 3.3})
    before = bytes(ffi.buffer(taken))
    lib.codec_read(5, b"\xff" * 8, taken)
    assert bytes(ffi.buffer(taken)) == before
    lib.codec_read(0, b"\xff" * 8, taken)
    assert bytes(ffi.buffer(taken)) != before


@pytest.mark.parametrize(
    ("before", "after"), [(0, 1), (2**32 - 2, 2**32 - 1), (2**32 - 1, 2**32 - 1)]
)
def test_the_periods_of_a_history_do_not_begin_anew(before: int, after: int) -> None:
    history = ffi.new("history_t *", {"periods": before})
    lib.history_step(history, ffi.new("kan_model_t *"), -1.0, 300.0, True)
    assert history.periods == after


@pytest.mark.parametrize(
    ("name", "value", "inside"),
    [
        ("CoolingPower", 3.0, True),
        ("CoolingPower", 3.01, True),
        ("CoolingPower", 3.02, False),
        ("Current", 0.52, True),
        ("Current", 0.53, False),
    ],
)
def test_a_reading_beside_the_training_by_no_more_than_its_error_is_taken_for_inside(
    name: str, value: float, inside: bool
) -> None:
    """lin2014 was trained for 0 to 3 W and up to 0.5 A; errors are 0.011 W and 0.0235 A."""
    bench = Bench()
    bench.follow_command = False
    bench.get_ready()
    bench.period(**{name: value})
    assert bool(bench.answer["InDomain"]) is inside


@pytest.mark.parametrize(
    ("value", "taken"), [(-24.02, -24.0), (-24.03, -24.03), (0.52, 0.5), (0.53, 0.53)]
)
def test_such_a_reading_is_estimated_at_the_edge(value: float, taken: float) -> None:
    estimates = []
    for current_A in (value, taken):
        bench = Bench()
        bench.follow_command = False
        bench.get_ready()
        bench.ecu._state.thermal.is_known = False
        bench.period(Current=current_A)
        estimates.append(bench.ecu._state.estimate.core_temperature_K)
    assert estimates[0] == estimates[1]


def planner_with(**changes: Any) -> Any:
    """A search that may begin, of a cell at half charge and 20 K below its limit."""
    planner = ffi.new("planner_t *")
    lib.planner_reset(planner)
    planner.start = {
        "temperature_K": [-20.0, -20.0, -20.0],
        "soc": 0.5,
        "soc_per_As": 1.0 / 8280.0,
        "cooling_power_W": 0.5,
        "resistance_ohm": 0.01,
        "total_ohm": 0.012,
        "family_resistance_ohm": 0.01,
    }
    planner.goal = {"strongest_A": 10.0, "time_left_s": -1.0}
    for path, value in changes.items():
        part, name = path.split("__")
        setattr(getattr(planner, part), name, value)
    return planner


@pytest.mark.parametrize(
    ("changes", "begins"),
    [
        ({}, True),
        ({"start__resistance_ohm": 1e-30}, True),
        ({"start__resistance_ohm": 0.0}, False),
        ({"goal__strongest_A": 1e-30}, True),
        ({"goal__strongest_A": 0.0}, False),
        ({"goal__time_left_s": math.nan}, False),
        ({"start__soc": math.inf}, False),
        ({"start__temperature_K": [-20.0, math.nan, -20.0]}, False),
    ],
)
def test_a_search_begins_where_start_and_goal_are_known(
    changes: dict[str, Any], begins: bool
) -> None:
    planner = planner_with(**changes)
    lib.planner_begin(planner)
    assert planner.is_searching is begins
    assert math.isnan(planner.planned_A)


def searched(planner: Any) -> Any:
    calibration = Ecu("lin2014")._calibration
    constants = [ffi.addressof(calibration, name) for name in ("planner", "rcbf", "family")]
    lib.planner_begin(planner)
    for _ in range(10_000):
        lib.planner_step(planner, *constants)
        if not planner.is_searching:
            break
    assert not planner.is_searching
    return planner


def test_a_cell_that_is_never_cool_enough_has_no_plan() -> None:
    hot = {"start__temperature_K": [60.0, 60.0, 60.0], "start__cooling_power_W": -10.0}
    planner = searched(planner_with(**hot))
    assert math.isnan(planner.planned_A) and math.isnan(planner.time_to_full_s)
    assert lib.planner_reference_A(planner, -7.0) == -7.0
    planner = searched(planner_with())
    assert 0.0 < planner.planned_A <= 10.0 and 0.0 < planner.time_to_full_s < 36_000.0


def test_current_falls_to_a_weaker_plan_by_a_quarter_of_the_growth() -> None:
    bench = Bench()
    bench.start()
    for _ in range(40):
        bench.period()
    planner, before_A = bench.ecu._state.planner, bench.command_A
    assert before_A < -5.0
    planner.is_searching, planner.age_s, planner.planned_A = False, 0.0, 1.0
    fall_A = 0.25 * bench.ecu._calibration.current_growth_A
    for period in (1, 2, 3):
        bench.period()
        assert bench.command_A - before_A == pytest.approx(period * fall_A, abs=0.0021)


def test_a_current_that_grows_as_fast_as_it_may_is_not_derated() -> None:
    bench = Bench(values={**HEALTHY, "Mode": FIXED, "ReferenceCurrent": -5.0})
    bench.start()
    for _ in range(60):
        bench.period()
    assert bench.command_A == pytest.approx(-5.0, abs=0.0021)
    for _ in range(20):
        before_A = bench.command_A
        bench.period(ReferenceCurrent=-15.0)
        assert bench.command_A < before_A
        assert bench.state == "Charging"


def test_a_plan_starts_from_what_is_read_now() -> None:
    bench = Bench()
    bench.start()
    start = bench.ecu._state.planner.start
    limit_K = bench.ecu._calibration.rcbf.max_core_temperature_K.high_K
    read_K = (bench.answer["CoreTemperature"], 299.0, 298.0)
    for above_K, temperature_K in zip(start.temperature_K, read_K):
        assert above_K == pytest.approx(temperature_K - limit_K, abs=0.1)
    assert start.soc == pytest.approx(0.5, abs=1e-3)
    assert start.cooling_power_W == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("planned_s", "asked", "left_s", "anew"),
    [
        (0.0, {"TimeToFull": 0.0}, 0.0, False),
        (900.0, {"TimeToFull": 900.0}, 900.0, False),
        (0.0, {"TimeToFull": 900.0}, 900.0, True),
        (900.0, {"TimeToFull": 0.0}, 0.0, True),
        (0.0, {"Mode": FASTEST}, -1.0, True),
    ],
)
def test_who_asks_for_another_time_gets_another_plan_at_once(
    planned_s: float, asked: dict[str, Any], left_s: float, anew: bool
) -> None:
    bench = Bench(values={**HEALTHY, "Mode": BY_TIME, "TimeToFull": planned_s})
    bench.start()
    for _ in range(5):
        bench.period()
    assert bench.ecu._state.planner.goal.time_left_s == pytest.approx(planned_s, abs=1.0)
    before_s = bench.ecu._state.planner.age_s
    bench.period(**asked)
    assert (bench.ecu._state.planner.age_s < before_s) is anew
    assert bench.ecu._state.planner.goal.time_left_s == pytest.approx(left_s, abs=1.0)


@pytest.mark.parametrize(
    ("planned_A", "reference_A"),
    [(3.0, -3.0), (7.0, -7.0), (9.0, -7.0), (0.0, 0.0), (-3.0, -7.0), (math.nan, -7.0)],
)
def test_a_plan_only_weakens_what_is_asked_for(planned_A: float, reference_A: float) -> None:
    planner = planner_with()
    planner.planned_A = planned_A
    assert lib.planner_reference_A(planner, -7.0) == reference_A


ERASED = 2**32 - 1


@pytest.mark.parametrize(
    ("version", "inverted", "status"),
    [
        (ERASED, ERASED, "IMAGE_OK"),
        (4, ERASED - 4, "IMAGE_OK"),
        (3, ERASED - 3, "IMAGE_OK"),
        (5, ERASED - 5, "IMAGE_ROLLED_BACK"),
        (4, ERASED - 5, "IMAGE_WRONG_FLOOR"),
        (ERASED, 0, "IMAGE_ROLLED_BACK"),
        (ERASED, 1, "IMAGE_WRONG_FLOOR"),
        (4, ERASED, "IMAGE_WRONG_FLOOR"),
    ],
)
def test_firmware_of_version_4_is_as_new_as_the_floor_says(
    version: int, inverted: int, status: str
) -> None:
    floor = ffi.new("image_floor_t *", {"version": version, "inverted_version": inverted})
    place = {"bytes": ffi.cast("uint8_t *", floor), "length": ffi.sizeof("image_floor_t")}
    header = ffi.new("image_header_t *", {"firmware_version": 4})
    found = lib.image_check_floor(ffi.new("image_memory_t *", place), header)
    assert ffi.typeof("image_status_t").elements[found] == status


@pytest.mark.parametrize(
    "content", [b"", b"123456789", *(bytes([n, n ^ 0x5A]) for n in range(256))]
)
def test_the_crc_of_an_image_is_that_of_zip_files(content: bytes) -> None:
    assert lib.image_crc32(content, len(content)) == zlib.crc32(content)


@pytest.mark.parametrize(
    ("reading", "faults"),
    [
        ({}, 0),
        ({"Current": 500.0}, 1 << 4),
        ({"Voltage": 0.5, "CoolingPower": -19.0}, 1 << 5 | 1 << 8),
    ],
)
def test_bit_n_says_that_the_reading_of_fault_n_is_outside_and_no_other(
    reading: dict[str, Any], faults: int
) -> None:
    bench = Bench()
    bench.start()
    bench.period(**reading)
    assert bench.ecu._state.outside == faults
