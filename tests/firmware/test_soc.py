"""Coulomb counting in float32 against exact sums."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from bms.barrier.rounding import ROUNDINGS, UNIT
from bms.firmware._firmware import ffi, lib

CAPACITY_AS, PERIOD_S = 8280.0, np.float32(0.1)


def counted(start: float, measured_A: list[float], commanded_A: list[float] | None = None) -> float:
    state = ffi.new("soc_t *")
    lib.soc_set(state, start)
    for measured, commanded in zip(measured_A, commanded_A or measured_A):
        lib.soc_count(state, measured, commanded, PERIOD_S, CAPACITY_AS)
    return float(state.soc)


@pytest.mark.parametrize("current_A", [-23.0, -2.3, -0.01, 5.0])
def test_a_long_count_of_small_steps_loses_nothing(current_A: float) -> None:
    steps = 20_000
    exact = Fraction(0.4) - steps * Fraction(float(np.float32(current_A))) * Fraction(
        float(PERIOD_S)
    ) / Fraction(CAPACITY_AS)
    assert counted(0.4, [current_A] * steps) == pytest.approx(float(exact), abs=3e-7)


def test_charging_raises_and_discharging_lowers() -> None:
    assert counted(0.5, [-10.0]) > 0.5 > counted(0.5, [10.0])


def test_the_fuller_of_the_measured_and_the_commanded_count_holds() -> None:
    weak, strong = [-10.0] * 100, [-10.5] * 100
    alone = counted(0.5, strong)
    assert counted(0.5, weak, strong) == counted(0.5, strong, weak) == alone > counted(0.5, weak)


def test_currents_that_agree_in_the_long_run_count_once() -> None:
    """A command one period late, or noise, does not add up to charge that is not there."""
    swinging = [-10.0, -20.0] * 500
    late = swinging[1:] + swinging[:1]
    one_period = 10.0 * float(PERIOD_S) / CAPACITY_AS
    assert counted(0.1, swinging, late) == pytest.approx(
        counted(0.1, swinging), abs=1.001 * one_period
    )


def test_float32_counts_within_its_share_of_the_error_bound() -> None:
    """Capacity, period, currents and plug-in value rounded to float32; charges up to full."""
    random = np.random.default_rng(1)
    for _ in range(20):
        capacity_As, period_s = random.uniform(2e3, 2e5), random.uniform(0.01, 1.0)
        start, steps = random.uniform(0.0, 0.5), 2000
        currents_A = random.uniform(-1.0, 0.2, steps)
        currents_A *= (1.0 - start) * capacity_As / (period_s * -np.sum(currents_A))
        state = ffi.new("soc_t *")
        lib.soc_set(state, start)
        for current_A in currents_A:
            lib.soc_count(state, current_A, current_A, period_s, capacity_As)
        assert float(state.soc) == pytest.approx(1.0, abs=ROUNDINGS * UNIT)
