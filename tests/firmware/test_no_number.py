"""What is no number admits no current, wherever in the decision it comes from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from bms.firmware._firmware import ffi, lib

NAN, LARGEST = float("nan"), 3.0e38
HEALTHY = {
    "soc": 0.5,
    "core_temperature_K": [300.0, 0.0],
    "surface_temperature_K": [299.0, 0.0],
    "coolant_temperature_K": [298.0, 0.0],
    "cooling_power_W": 0.5,
    "reference_current_A": -23.0,
}


def solve(change: Callable[[Any], None], **inputs: Any) -> Any:
    """A decision with changed constants that are not checked before."""
    constants = ffi.new("rcbf_constants_t *", lib.host_default_calibration().rcbf)
    change(constants)
    return lib.rcbf_solve(constants, ffi.new("rcbf_input_t *", {**HEALTHY, **inputs}))


def tiny_step(constants: Any) -> None:
    constants.ocv_soc[0], constants.ocv_soc[1] = 0.0, 1e-40


def huge_step(constants: Any) -> None:
    for point in range(constants.ocv_points):
        constants.ocv_V[point] = LARGEST if point > 0 else -LARGEST


NUMBERS = [
    name
    for name, kind in ffi.typeof("rcbf_constants_t").fields
    if kind.type is ffi.typeof("float") and name != "max_soc"
]


def test_the_healthy_case_charges() -> None:
    assert solve(lambda constants: None).current_A < -1.0


@pytest.mark.parametrize("change", [tiny_step, huge_step])
def test_a_table_whose_first_step_makes_no_number_admits_nothing(
    change: Callable[[Any], None],
) -> None:
    decision = solve(change, soc=0.0)
    assert (decision.feasible, decision.current_A) == (False, 0.0)


@pytest.mark.parametrize("name", NUMBERS)
def test_a_constant_that_is_no_number_admits_nothing(name: str) -> None:
    decision = solve(lambda constants: setattr(constants, name, NAN))
    assert (decision.feasible, decision.current_A) == (False, 0.0)


@pytest.mark.parametrize("name", ["max_core_temperature_K", "max_surface_temperature_K"])
def test_a_limit_that_is_no_number_admits_nothing(name: str) -> None:
    decision = solve(lambda constants: setattr(getattr(constants, name), "high_K", NAN))
    assert (decision.feasible, decision.current_A) == (False, 0.0)
