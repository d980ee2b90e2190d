"""The monitor's short ways are those of its policy table, row by row and over long sequences."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

import pytest

from tests.firmware.native_library import FIRMWARE, load_library

Native = tuple[Any, Any]
FAULTS, MOST_PERIODS, NONE = 21, 255, 255
POLICY = f"extern const fault_policy_t MONITOR_POLICY[{FAULTS}];"
SHARES = (0.01, 0.2, 0.6)


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Native:
    return load_library(
        tmp_path_factory.mktemp("monitor"),
        [FIRMWARE / "src" / "monitor.c"],
        ["include/monitor.h"],
        extra=POLICY,
    )


@dataclass
class Reference:
    """The table as it reads, with no way shorter than another: every fault in every period."""

    policy: list[Any]
    window: int
    lasted: list[int] = field(default_factory=lambda: [0] * FAULTS)
    returned: list[int] = field(default_factory=lambda: [0] * FAULTS)
    latched: int = 0
    first: int = NONE

    def latch(self, fault: int) -> None:
        self.first = self.first if self.latched else fault
        self.latched |= 1 << fault

    def step(self, symptoms: int) -> None:
        for fault, row in enumerate(self.policy):
            self.returned[fault] = max(0, self.returned[fault] - 1)
            if not symptoms >> fault & 1:
                self.lasted[fault] = 0
                continue
            if not self.lasted[fault] and row.returns:
                most = row.returns * self.window
                self.returned[fault] = min(most, self.returned[fault] + self.window)
                if self.returned[fault] > most - self.window:
                    self.latch(fault)
            self.lasted[fault] = min(MOST_PERIODS, self.lasted[fault] + 1)
            if self.lasted[fault] >= row.debounce_periods:
                self.latch(fault)

    def stops(self, symptoms: int) -> bool:
        return any(row.stops_at_once and symptoms >> f & 1 for f, row in enumerate(self.policy))


def test_a_symptom_stops_as_its_row_says(native: Native) -> None:
    _, lib = native
    rows = [bool(lib.MONITOR_POLICY[fault].stops_at_once) for fault in range(FAULTS)]
    assert [lib.monitor_stops(1 << fault) for fault in range(FAULTS)] == rows
    assert 0 < sum(rows) < FAULTS == lib.FAULT_COUNT
    assert not lib.monitor_stops(0)
    harmless = sum(1 << fault for fault, stops in enumerate(rows) if not stops)
    assert not lib.monitor_stops(harmless)
    for fault in range(FAULTS):
        assert lib.monitor_stops(harmless | 1 << fault) == rows[fault]


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("seed", range(3))
def test_what_is_skipped_would_have_changed_nothing(
    native: Native, seed: int, share: float
) -> None:
    ffi, lib = native
    draw, monitor = random.Random(seed), ffi.new("monitor_t *")
    reference = Reference(list(lib.MONITOR_POLICY), lib.MONITOR_RETURN_PERIODS)
    lib.monitor_reset(monitor)
    symptoms = 0
    for period in range(4000):
        for fault in range(FAULTS):
            if draw.random() < share / (1 + 20 * (period // 1000 % 2)):
                symptoms ^= 1 << fault
        if period % 500 > 480:
            symptoms = 0
        lib.monitor_step(monitor, symptoms)
        reference.step(symptoms)
        assert list(monitor.lasted) == reference.lasted
        assert list(monitor.returned) == reference.returned
        assert (monitor.latched, monitor.first) == (reference.latched, reference.first)
        assert monitor.stop == reference.stops(symptoms)
        assert monitor.active == symptoms


@pytest.mark.parametrize(
    "change",
    [
        ("BIT(FAULT_VOLTAGE_DEVIATION) |", "BIT(FAULT_OVER_VOLTAGE) |"),
        ("(BIT(FAULT_COUNT) - 1u)", "(BIT(FAULT_COUNT - 1) - 1u)"),
        ("symptoms | monitor->counting;", "symptoms;"),
        ("|| (monitor->returned[fault] != 0u)", ""),
        ("counting |= BIT(fault);", "counting = BIT(fault);"),
    ],
    ids=lambda change: change[1] or change[0],
)
def test_a_wrong_short_way_is_noticed(
    change: tuple[str, str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    broken = load_library(
        tmp_path_factory.mktemp("broken"),
        [FIRMWARE / "src" / "monitor.c"],
        ["include/monitor.h"],
        ("monitor.c", *change),
        extra=POLICY,
    )
    with pytest.raises(AssertionError):
        test_a_symptom_stops_as_its_row_says(broken)
        test_what_is_skipped_would_have_changed_nothing(broken, 0, SHARES[1])
