"""A symptom that its own reaction removes becomes a fault when it comes back too often."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from tests.firmware.native_library import FIRMWARE, load_library

Native = tuple[Any, Any]


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Native:
    sources = [FIRMWARE / "src" / "monitor.c"]
    return load_library(
        tmp_path_factory.mktemp("monitor"),
        sources,
        ["include/monitor.h"],
        extra="extern const fault_policy_t MONITOR_POLICY[21];",
    )


def returning(native: Native) -> list[int]:
    """Faults with a number of returns."""
    _, lib = native
    return [fault for fault in range(lib.FAULT_COUNT) if lib.MONITOR_POLICY[fault].returns > 0]


def latched(native: Native, fault: int, seen_at: Iterable[int]) -> bool:
    """Whether a symptom that is seen in these periods alone has become a fault."""
    ffi, lib = native
    monitor, periods = ffi.new("monitor_t *"), set(seen_at)
    lib.monitor_reset(monitor)
    for period in range(max(periods) + 1):
        lib.monitor_step(monitor, (1 << fault) if period in periods else 0)
    return bool(monitor.latched >> fault & 1)


def spread(count: int, over: int) -> list[int]:
    """Periods of `count` symptoms of one period each, the last one `over` after the first."""
    return [round(i * over / (count - 1)) for i in range(count)]


def test_currents_of_no_charger_the_domain_what_is_over_a_limit_and_damaged_frames_do_not_return(
    native: Native,
) -> None:
    lib = native[1]
    assert returning(native) == [
        lib.FAULT_CURRENT_RANGE,
        lib.FAULT_OUT_OF_DOMAIN,
        lib.FAULT_OVER_VOLTAGE,
        lib.FAULT_CORE_OVER_TEMPERATURE,
        lib.FAULT_SURFACE_OVER_TEMPERATURE,
        lib.FAULT_CORRUPTED_FRAMES,
    ]


def test_the_last_of_its_returns_within_the_window_latches(native: Native) -> None:
    for fault in returning(native):
        returns = native[1].MONITOR_POLICY[fault].returns
        for over in (2 * returns, native[1].MONITOR_RETURN_PERIODS - 1):
            assert latched(native, fault, spread(returns, over)), (fault, over)
            assert not latched(native, fault, spread(returns, over)[:-1]), (fault, over)


def test_as_many_over_a_longer_time_do_not(native: Native) -> None:
    for fault in returning(native):
        returns = native[1].MONITOR_POLICY[fault].returns
        assert not latched(native, fault, spread(returns, native[1].MONITOR_RETURN_PERIODS))


def test_the_same_rate_over_a_longer_time_does(native: Native) -> None:
    window = native[1].MONITOR_RETURN_PERIODS
    for fault in returning(native):
        returns = native[1].MONITOR_POLICY[fault].returns
        every = window // returns
        assert latched(native, fault, range(0, 20 * window, every))
        assert not latched(native, fault, range(0, 20 * window, window + 1))


def test_a_symptom_that_stays_returns_once(native: Native) -> None:
    lib = native[1]
    fault = lib.FAULT_OUT_OF_DOMAIN
    debounce = lib.MONITOR_POLICY[fault].debounce_periods
    assert not latched(native, fault, range(debounce - 1))
    assert latched(native, fault, range(debounce))


def test_a_symptom_without_a_number_may_come_and_go(native: Native) -> None:
    lib = native[1]
    assert not latched(native, lib.FAULT_ELECTRICAL_MISSING, range(0, 2000, 2))


def test_a_reset_forgets_what_has_come_back(native: Native) -> None:
    ffi, lib = native
    fault = lib.FAULT_OVER_VOLTAGE
    monitor = ffi.new("monitor_t *")
    for _ in range(5):
        lib.monitor_reset(monitor)
        for symptoms in (1 << fault, 0) * (lib.MONITOR_POLICY[fault].returns - 1):
            lib.monitor_step(monitor, symptoms)
        assert monitor.latched == 0


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("if (sum > most - (uint32_t)MONITOR_RETURN_PERIODS)", "if (sum > most)"),
        ("monitor->returned[fault]--;", "monitor->returned[fault] = 0u;"),
        ("count_return(monitor, fault);", "(void)count_return;"),
        ("monitor->returned[fault] = 0u;", "(void)0;"),
    ],
)
def test_a_broken_count_is_noticed(
    old: str, new: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    sources = [FIRMWARE / "src" / "monitor.c"]
    mutant = load_library(
        tmp_path_factory.mktemp("mutant"),
        sources,
        ["include/monitor.h"],
        ("monitor.c", old, new),
        "extern const fault_policy_t MONITOR_POLICY[21];",
    )
    checks = (
        test_the_last_of_its_returns_within_the_window_latches,
        test_a_reset_forgets_what_has_come_back,
    )
    with pytest.raises(AssertionError):
        for check in checks:
            check(mutant)
