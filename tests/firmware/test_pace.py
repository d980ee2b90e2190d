"""Time as an input: a control period lasts one sampling period by the plant's own count."""

from __future__ import annotations

from typing import Any

import pytest

from bms.firmware._firmware import ffi, lib
from tests.firmware.bench import STATES, Bench, frame
from tests.firmware.test_ecu_loop import PERIOD_MS, SYNC, Port, library

__all__ = ["library"]

OUT_OF_STEP = 20
ALLOWED_PERIODS = 10
"""More of the plant's periods than steps of the ECU, before it is a fault."""
FORGOTTEN_PERIODS = 128
"""Periods in which one of them is forgotten."""
CAPACITY_AS = 2.3 * 3600.0
CHARGING = ("Charging", "Derated")


def with_sync_of_others(port: Port, first: int, last: int, sync_ms: float) -> None:
    """Periods of a cell by the plant's clock, while somebody else sends SYNC by another."""
    for period in range(first, last):
        start_ms = port.now_ms
        number = -(-start_ms // sync_ms)
        while number * sync_ms < start_ms + PERIOD_MS:
            port.waiting.append((round(number * sync_ms), SYNC))
            number += 1
        port.charge(period, period + 1)


def latched(port: Port) -> set[int]:
    """Numbers of the latched faults."""
    bits = int(port.loop.bms.monitor.latched)
    return {n for n in range(32) if bits >> n & 1}


@pytest.mark.parametrize("sync_ms", [105.0, 190.0, 320.0])
def test_a_sync_of_others_that_is_too_slow_ends_the_charge(
    library: tuple[Any, Any], sync_ms: float
) -> None:
    """Else each step counts 0.1 s, and the cell is fuller and warmer than the ECU believes."""
    port, true_soc, slowness = Port(*library), 0.5, sync_ms / PERIOD_MS - 1.0
    with_sync_of_others(port, 0, 15, sync_ms)
    assert STATES[port.loop.bms.state] in CHARGING
    deadline = ALLOWED_PERIODS / (slowness - (1.0 + slowness) / FORGOTTEN_PERIODS)
    for period in range(15, 15 + round(deadline * (1.0 + slowness)) + 15):
        true_soc -= float(port.command()["CommandCurrent"]) * 0.1 / CAPACITY_AS
        with_sync_of_others(port, period, period + 1, sync_ms)
    assert latched(port) == {OUT_OF_STEP}
    assert port.command()["CommandCurrent"] == 0.0
    uncounted_s = (ALLOWED_PERIODS + deadline / FORGOTTEN_PERIODS + 5) * PERIOD_MS / 1000.0
    assert true_soc - port.loop.bms.soc.soc <= 5.0 * uncounted_s / CAPACITY_AS


@pytest.mark.parametrize("sync_ms", [100.0, 100.5])
def test_clocks_that_differ_a_little_are_no_fault(library: tuple[Any, Any], sync_ms: float) -> None:
    port = Port(*library)
    with_sync_of_others(port, 0, 300, sync_ms)
    assert STATES[port.loop.bms.state] in CHARGING


def steps(*measured_periods: int) -> list[bool]:
    """Whether the pace is lost after each control period, in which so many were measured."""
    pace, lost = ffi.new("pace_t *"), []
    for periods in measured_periods:
        lib.pace_step(pace, periods)
        lost.append(bool(lib.pace_is_lost(pace)))
    return lost


def test_one_more_than_allowed_is_lost() -> None:
    at_most = 1 + ALLOWED_PERIODS
    assert steps(at_most) == [False]
    assert steps(at_most + 1) == [True]
    assert steps(*[2] * ALLOWED_PERIODS, 1, 1, 1)[-1] is False
    assert steps(*[2] * (ALLOWED_PERIODS + 1))[-1] is True


def test_what_is_ahead_is_forgotten_one_in_128_periods() -> None:
    behind = [2] * ALLOWED_PERIODS
    assert steps(*behind, *[1] * FORGOTTEN_PERIODS, 2)[-1] is False
    assert steps(*behind, *[1] * (FORGOTTEN_PERIODS // 2), 3)[-1] is True


def test_lost_frames_are_made_up_for_by_the_counter_and_give_no_credit_beyond() -> None:
    assert not any(steps(*[0, 0, 3] * 100))
    assert steps(*[0] * 100, 15)[-1] is True, "100 silent periods are worth three"
    assert steps(*[0] * 100, 14)[-1] is False


def test_a_lost_measurement_in_each_window_is_no_fault() -> None:
    """The frame after a lost one counts for both."""
    bench = Bench()
    bench.start()
    for period in range(100):
        bench.period(drop=("CellElectrical",) if period % 7 == 0 else ())
    assert bench.ecu._state.monitor.latched == 0
    assert bench.ecu._state.pace.ahead <= 0


def test_what_came_before_the_charge_does_not_count() -> None:
    bench = Bench()
    bench.get_ready()
    for _ in range(2 * ALLOWED_PERIODS):
        sent = [
            frame("CellElectrical", bench.counters["CellElectrical"] + n, bench.values)
            for n in range(2)
        ]
        bench.counters["CellElectrical"] += 1
        bench.period(replace={"CellElectrical": sent})
    bench.period(Request=1)
    bench.period()
    assert bench.state in CHARGING
