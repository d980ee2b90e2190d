"""The filters in C: equal to Python's, settled before trusted, deaf to bad readings."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bms.data.lags import Lag
from bms.data.measurements import Measurements
from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from bms.model.model_file import shipped_model_path
from tests.firmware.bench import READY_PERIODS, Bench

LAGS = (
    Lag("current_squared_A2", 10.0),
    Lag("current_squared_A2", 160.0),
    Lag("surface_temperature_rise_K", 10.0),
    Lag("surface_temperature_rise_K", 160.0),
)
PERIOD_S = 0.1
SETTLING_PERIODS = 150
"""Five time constants of 3 s."""


def bench_with_memory() -> Bench:
    return Bench(ecu=Ecu("lin2014", shipped_model_path("lin2014", lagged=True)))


def model_in_c(settling_periods: int = 0) -> Any:
    fields = [
        {
            "quantity": int(lag.quantity != "current_squared_A2"),
            "decay": lag.decay(PERIOD_S),
            "gain": lag.gain(PERIOD_S),
        }
        for lag in LAGS
    ]
    return ffi.new(
        "kan_model_t *", {"lags": len(LAGS), "lag": fields, "settling_periods": settling_periods}
    )


def test_filters_keep_to_double_precision_through_a_long_charge() -> None:
    rng = np.random.default_rng(2)
    rows = 20_000
    current_A = np.repeat(rng.uniform(-23.0, 0.0, rows // 200), 200)
    current_A[0] = 0.0
    surface_K = np.round((300.0 + np.cumsum(rng.normal(0.0, 2e-3, rows))) / 0.005) * 0.005
    zero = np.zeros(rows)
    oracle = Measurements(np.arange(rows) * PERIOD_S, current_A, zero, surface_K, zero, zero)
    expected = oracle.samples(LAGS).inputs[:, 4:]
    history, model = ffi.new("history_t *"), model_in_c()
    for row in range(rows):
        flowed_A = float(current_A[row - 1]) if row else 0.0
        lib.history_step(history, model, flowed_A, float(surface_K[row]), True)
        if row % 500 == 0:
            assert list(history.filtered)[:2] == pytest.approx(expected[row, :2], abs=0.05)
            assert list(history.filtered)[2:] == pytest.approx(expected[row, 2:], abs=2e-4)


@pytest.mark.parametrize(
    ("current_A", "surface_K", "usable"),
    [(-40.0, 250.0, False), (math.nan, 300.0, True), (-5.0, math.inf, True)],
)
def test_a_reading_that_is_no_good_is_bridged_with_the_last_one(
    current_A: float, surface_K: float, usable: bool
) -> None:
    bad, good, model = ffi.new("history_t *"), ffi.new("history_t *"), model_in_c()
    for _ in range(20):
        for history in (bad, good):
            lib.history_step(history, model, -10.0, 300.0, True)
    for _ in range(lib.HISTORY_MAX_BRIDGED):
        lib.history_step(bad, model, current_A, surface_K, usable)
        lib.history_step(good, model, -10.0, 300.0, True)
    assert list(bad.filtered) == list(good.filtered)
    assert all(map(math.isfinite, bad.filtered))


def test_a_longer_gap_starts_the_history_anew_and_never_reads_as_settling_without_readings() -> (
    None
):
    history, model = ffi.new("history_t *"), model_in_c(settling_periods=5)
    for _ in range(9):
        lib.history_step(history, model, -10.0, 300.0, True)
    assert not lib.history_is_settling(history, model)
    for _ in range(lib.HISTORY_MAX_BRIDGED + 1):
        lib.history_step(history, model, -10.0, 300.0, False)
    assert list(history.filtered) == [0.0] * 4
    assert history.periods == 0
    assert not lib.history_is_settling(history, model)
    lib.history_step(history, model, -10.0, 300.0, True)
    assert lib.history_is_settling(history, model)


def test_ecu_with_memory_stays_in_init_until_its_filters_have_settled() -> None:
    bench = bench_with_memory()
    for _ in range(READY_PERIODS + SETTLING_PERIODS - 2):
        bench.period(Request=0)
        assert (bench.state, bench.command_A) == ("Init", 0.0)
        assert bench.answer["InDomain"] == 0
    bench.period(Request=0)
    assert bench.state == "Standby"
    assert bench.answer["InDomain"] == 1
    bench.period(Request=1)
    assert bench.state == "Charging"


def test_ecu_with_memory_gives_no_current_after_a_gap_until_settled_again() -> None:
    bench = bench_with_memory()
    bench.get_ready()
    for _ in range(SETTLING_PERIODS - 1):
        bench.period(Request=0)
    bench.period(Request=1)
    assert bench.period()["CommandCurrent"] < 0.0
    for _ in range(lib.HISTORY_MAX_BRIDGED + 1):
        bench.period(drop=("CellThermal",))
    waited = 0
    while bench.state != "Standby":
        bench.period(Request=0)
        assert bench.command_A == 0.0
        waited += 1
    # The first frame after the gap only brings the message counter up to date, and the message is
    # not valid again before the fourth good one.
    assert waited == 1 + 3 + SETTLING_PERIODS
    bench.period(Request=1)
    assert bench.state == "Charging"


@pytest.mark.parametrize("lost", [1, 2])
def test_frames_lost_while_settling_are_bridged_and_change_nothing(lost: int) -> None:
    """Three in a row are a fault of their own."""
    bench = bench_with_memory()
    for period in range(READY_PERIODS + SETTLING_PERIODS - 2):
        bench.period(drop=("CellThermal",) if 50 <= period < 50 + lost else (), Request=0)
        assert (bench.state, bench.latched()) == ("Init", set())
    bench.period(Request=0)
    assert bench.state == "Standby"


def test_faults_are_seen_while_the_filters_settle() -> None:
    bench = bench_with_memory()
    bench.period(Request=0)
    for _ in range(3):
        bench.period(Voltage=4.6, SurfaceTemperature=336.0)
        assert bench.command_A == 0.0
    assert bench.state == "Fault"
    assert {13, 15} <= bench.latched()


def test_silence_from_the_start_is_a_fault_and_not_an_endless_start() -> None:
    bench = bench_with_memory()
    for _ in range(60):
        bench.period(drop=("CellElectrical", "CellThermal"), Request=0)
    assert bench.state == "Fault"
    assert {0, 1} <= bench.latched()
