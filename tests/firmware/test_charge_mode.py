"""The optional message that says how to charge: obeyed where it can be, missed by nobody."""

from __future__ import annotations

from typing import Any

import pytest

from tests.firmware.bench import DATABASE, HEALTHY, Bench, frame

FASTEST, BY_TIME, FIXED, NOT_AVAILABLE = 0, 1, 2, 15
REQUEST_INVALID, CORRUPTED_FRAMES = 9, 16
UNKNOWN = 3
NOT_HAD = [*range(UNKNOWN, 15), NOT_AVAILABLE]
NO_TIME = 0xFFFF
PLAN_EVERY = 5
WINDOW_PERIODS = 5


def bench_with(mode: int) -> Bench:
    return Bench(values={**HEALTHY, "Mode": mode, "TimeToFull": 900.0})


def active(bench: Bench) -> set[int]:
    bits = int(bench.answer["ActiveFaults"])
    return {n for n in range(20) if bits >> n & 1}


def test_who_asks_for_no_mode_gets_the_fastest_charge() -> None:
    with_mode, without = bench_with(FASTEST), Bench()
    report = DATABASE.get_message_by_name("NetworkDiagnostics")
    of_the_network = {signal.name for signal in report.signals}

    def said(bench: Bench, period: int) -> dict[str, Any]:
        answer = bench.period(Request=period > 5)
        return {name: value for name, value in answer.items() if name not in of_the_network}

    for period in range(60):
        assert said(with_mode, period) == said(without, period)
        assert ("PlannedCurrent" in without.answer) == (period % PLAN_EVERY == 0)
    assert without.command_A < -5.0


@pytest.mark.parametrize("mode", [FASTEST, BY_TIME])
def test_a_planned_mode_charges_and_tells_its_plan(mode: int) -> None:
    bench = bench_with(mode)
    bench.start()
    told = [bench.period() for _ in range(30 * PLAN_EVERY)]
    plans = [answer for answer in told if "PlannedCurrent" in answer]
    assert len(plans) == 30
    assert (bench.state, active(bench)) == ("Charging", set())
    assert -23.0 <= plans[-1]["PlannedCurrent"] < 0.0
    assert 150.0 < plans[-1]["PredictedTimeToFull"] < 901.0


@pytest.mark.parametrize("mode", [FIXED, UNKNOWN])
def test_no_plan_is_told_to_who_wants_none(mode: int) -> None:
    bench = bench_with(mode)
    bench.start()
    assert not any("PlannedCurrent" in bench.period() for _ in range(4 * PLAN_EVERY))


def test_a_charge_by_time_needs_the_time() -> None:
    bench = bench_with(BY_TIME)
    bench.start()
    for _ in range(3):
        bench.period(TimeToFull=NO_TIME)
        assert (bench.command_A, active(bench)) == (0.0, {REQUEST_INVALID})
    assert (bench.state, bench.latched()) == ("Fault", {REQUEST_INVALID})


@pytest.mark.parametrize("mode", NOT_HAD)
def test_with_a_mode_that_the_ecu_does_not_have_no_charge_begins(mode: int) -> None:
    bench = bench_with(mode)
    bench.get_ready()
    assert (bench.state, active(bench)) == ("Standby", set())
    for period in range(3):
        bench.period(Request=1)
        assert (bench.command_A, active(bench)) == (0.0, {REQUEST_INVALID}), period
    assert (bench.state, bench.latched()) == ("Fault", {REQUEST_INVALID})


@pytest.mark.parametrize("mode", NOT_HAD)
def test_in_a_charge_such_a_mode_stops_it_at_once_and_latches(mode: int) -> None:
    bench = bench_with(FASTEST)
    bench.start()
    assert bench.command_A < 0.0
    for _ in range(3):
        bench.period(Mode=mode)
        assert bench.command_A == 0.0
    assert (bench.state, bench.latched()) == ("Fault", {REQUEST_INVALID})


@pytest.mark.parametrize("lost", [1, 2])
def test_lost_frames_do_not_make_the_ecu_forget_what_was_asked_for(lost: int) -> None:
    bench = bench_with(UNKNOWN)
    bench.get_ready()
    for _ in range(2):
        bench.period()
    for _ in range(lost):
        bench.period(drop=("ChargeMode",), Request=1)
        assert (bench.state, bench.command_A) == ("Standby", 0.0)


def test_a_message_that_goes_away_is_no_symptom_and_what_it_asked_for_ends() -> None:
    bench = bench_with(FIXED)
    bench.start()
    for _ in range(4 * WINDOW_PERIODS):
        bench.period(drop=("ChargeMode",))
        assert (bench.state, active(bench)) == ("Charging", set())
        assert bench.command_A < 0.0

    bench = bench_with(UNKNOWN)
    bench.get_ready()
    for _ in range(WINDOW_PERIODS):
        bench.period(drop=("ChargeMode",))
    bench.period(drop=("ChargeMode",), Request=1)
    assert bench.state == "Charging"


def test_a_message_that_begins_in_a_charge_counts_once_it_is_valid() -> None:
    bench = Bench()
    bench.start()
    for _ in range(2):
        assert bench.period(Mode=UNKNOWN)["CommandCurrent"] < 0.0
    assert bench.period()["CommandCurrent"] == 0.0
    assert active(bench) == {REQUEST_INVALID}


def damaged(sent: tuple[int, bytes]) -> list[tuple[int, bytes]]:
    return [(sent[0], bytes([sent[1][0] ^ 1]) + sent[1][1:])]


@pytest.mark.parametrize(
    "contest",
    [
        damaged,
        lambda sent: [(sent[0], sent[1][:-1])],
        lambda sent: [sent, sent],
        lambda sent: [*damaged(sent), sent],
    ],
    ids=["wrong CRC", "wrong length", "repeated", "a damaged one beside the good one"],
)
@pytest.mark.parametrize("is_used", [True, False], ids=["after good ones", "never good"])
def test_corrupted_or_contested_frames_are_a_disturbance_as_of_any_message(
    contest: Any, is_used: bool
) -> None:
    bench = bench_with(FASTEST) if is_used else Bench()
    bench.start()
    for period in range(3):
        counter = bench.counters["ChargeMode"]
        frames = contest(frame("ChargeMode", counter, {**bench.values, "Mode": FASTEST}))
        if is_used:
            bench.period(replace={"ChargeMode": frames})
        else:
            for frame_id, data in frames:
                bench.ecu.receive(frame_id, data)
            bench.counters["ChargeMode"] += 1
            bench.period()
        assert active(bench) == {CORRUPTED_FRAMES}, period
    assert (bench.state, bench.latched()) == ("Fault", {CORRUPTED_FRAMES})
