"""Somebody who sends a measurement beside the plant, with a running counter and the right CRC."""

from __future__ import annotations

import pytest

from tests.firmware.bench import Bench, frame

CORRUPTED_FRAMES = 16
TRUE_VOLTAGE_V = 3.95
AHEAD, BEHIND = "ahead", "behind"
PATTERNS = [(1,), (1, 0), (1, 1, 0), (1, 0, 0), (1, 1, 1, 0), (1, 0, 1, 1, 0)]


def periods_with_current(where: str, pattern: tuple[int, ...], steps_ahead: int) -> int:
    """Until the fault, while the cell is far over its voltage limit and the pattern hides it."""
    bench, with_current = Bench(), 0
    bench.start()
    for period in range(60):
        counter = bench.counters["CellElectrical"]
        true = frame("CellElectrical", counter, {**bench.values, "Voltage": TRUE_VOLTAGE_V})
        sent = [true]
        if pattern[period % len(pattern)]:
            sent.append(frame("CellElectrical", counter + steps_ahead, bench.values))
        if where == AHEAD:
            sent.reverse()
        bench.period(replace={"CellElectrical": sent})
        with_current += bench.command_A < 0.0
        if bench.state == "Fault":
            return with_current
    raise AssertionError(
        f"{where} {pattern} by {steps_ahead}: no fault, {with_current} with current"
    )


@pytest.mark.parametrize("where", [AHEAD, BEHIND])
@pytest.mark.parametrize("steps_ahead", [0, 1, 2, 3])
def test_a_voltage_that_somebody_hides_now_and_then_ends_the_charge(
    where: str, steps_ahead: int
) -> None:
    """Runs of corrupted periods are too short here to be a fault; their return is one."""
    worst = max(periods_with_current(where, pattern, steps_ahead) for pattern in PATTERNS)
    assert worst <= 15


def test_five_damaged_frames_in_a_minute_are_a_fault_and_four_are_none() -> None:
    for damaged, expected in ((4, set()), (5, {CORRUPTED_FRAMES})):
        bench = Bench()
        bench.start(ReferenceCurrent=-0.1)
        for period in range(5 * damaged):
            other = frame("Coolant", bench.counters["Coolant"] + 7, bench.values)
            true = frame("Coolant", bench.counters["Coolant"], bench.values)
            hit = period % 5 == 0
            bench.period(replace={"Coolant": [true, other] if hit else [true]})
        assert bench.latched() == expected
