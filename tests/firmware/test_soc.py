"""Coulomb counting in float32 against exact sums."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from bms.firmware._firmware import ffi, lib

CAPACITY_AS, PERIOD_S = 8280.0, np.float32(0.1)


def counted(start: float, currents_A: list[float]) -> float:
    counter = ffi.new("soc_t *")
    lib.soc_set(counter, start)
    for current in currents_A:
        lib.soc_count(counter, current, PERIOD_S, CAPACITY_AS)
    return float(counter.soc)


@pytest.mark.parametrize("current_A", [-23.0, -2.3, -0.01, 5.0])
def test_a_long_count_of_small_steps_loses_nothing(current_A: float) -> None:
    steps = 20_000
    exact = Fraction(0.4) - steps * Fraction(float(np.float32(current_A))) * Fraction(
        float(PERIOD_S)
    ) / Fraction(CAPACITY_AS)
    assert counted(0.4, [current_A] * steps) == pytest.approx(float(exact), abs=3e-7)


def test_charging_raises_and_discharging_lowers() -> None:
    assert counted(0.5, [-10.0]) > 0.5 > counted(0.5, [10.0])
