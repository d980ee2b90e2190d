"""The decision at the edges of what it takes, on constants so simple that its roots are known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib

LIMIT_K = 320.0
LARGEST = float(np.finfo(np.float32).max)
CURRENT_A = -10.0


def constants(**changes: float) -> Any:
    """Of the constraints only the core's: c - q u^2, where c is LIMIT_K less the core and q 1."""
    values: dict[str, Any] = {
        "max_core_temperature_K": (LIMIT_K, 0.0),
        "max_surface_temperature_K": (440.0, 0.0),
        "alpha1_per_s": 1e6,
        "alpha2_per_s": 1.0,
        "alpha3_per_s2": 1e6,
        "a1_per_s": 1.0,
        "a3_K_per_A2s": 1.0,
        "a9_K_per_A2s2": -1e-6,
        "a10_K_per_Ws2": 1.0,
        "capacity_As": 8280.0,
        "ohmic_resistance_ohm": 0.01,
        "max_voltage_V": 4.0,
        "max_soc": 1.0,
        "ocv_points": 2,
        "ocv_soc": [0.0, 1.0],
        "ocv_V": [3.0, 3.4],
    }
    made = ffi.new("rcbf_constants_t *", {**values, **changes})
    assert lib.rcbf_constants_are_valid(made)
    return made


def state(core_K: float = 300.0, **changes: Any) -> dict[str, Any]:
    same = {name: (core_K, 0.0) for name in ("core", "surface", "coolant")}
    named = {f"{name}_temperature_K": value for name, value in same.items()}
    rest = {"cooling_power_W": 0.5, "soc": 0.5, "reference_current_A": CURRENT_A}
    return {**named, **rest, **changes}


def solve(k: Any, values: dict[str, Any]) -> Any:
    return lib.rcbf_solve(k, ffi.new("rcbf_input_t *", values))


LOW_PART = 450.0 * 2.0**-23
BOUNDS = {
    **{
        f"{part}_temperature_K.{half}": bounds
        for part in ("core", "surface", "coolant")
        for half, bounds in (("high", (150.0, 450.0)), ("low", (-LOW_PART, LOW_PART)))
    },
    "soc": (-0.1, 1.1),
    "cooling_power_W": (-1e4, 1e4),
    "reference_current_A": (-1e4, 0.0),
}


def with_value(path: str, value: float) -> dict[str, Any]:
    name, _, half = path.partition(".")
    if not half:
        return state(**{name: value})
    return state(**{name: (value, 0.0) if half == "high" else (300.0, value)})


@pytest.mark.parametrize("path", BOUNDS)
def test_each_input_is_taken_up_to_its_bounds_and_not_beyond(path: str) -> None:
    calibration = Ecu("lin2014")._calibration  # has the constants in it, so must stay
    k = ffi.new("rcbf_constants_t *", calibration.rcbf)
    for bound, beyond in zip(BOUNDS[path], (-math.inf, math.inf)):
        at = np.float32(bound)
        assert solve(k, with_value(path, float(at))).active != lib.RCBF_INVALID
        next_one = float(np.nextafter(at, np.float32(beyond)))
        for value in (next_one, beyond, math.nan):
            decision = solve(k, with_value(path, value))
            assert decision.active == lib.RCBF_INVALID, value
            assert (decision.current_A, decision.feasible) == (0.0, False)


@pytest.mark.parametrize(
    ("room_K", "error_K", "expected_A"),
    [
        (4.0, 0.0, -2.0),
        (120.0, 0.0, CURRENT_A),
        (0.0, 0.0, 0.0),
        (4.0, 1.0, -math.sqrt(3.0)),
        (100.5, 0.75, -math.sqrt(99.75)),
        (101.0, 0.5, CURRENT_A),
        (100.0, 0.0625, -math.sqrt(99.9375)),
        (2.0**-9, 2.0**-12, -math.sqrt(2.0**-9 - 2.0**-12)),
        (0.5, 0.75, None),
    ],
)
def test_the_current_rides_the_root_of_the_stricter_function(
    room_K: float, error_K: float, expected_A: float | None
) -> None:
    """With gains that differ by 1 the error takes as much of the room as it has K."""
    k = constants(estimation_error_bound_K=error_K, a1_per_s=2.0)
    k.max_core_temperature_K.high_K = 300.0 + room_K
    decision = solve(k, state(300.0))
    assert decision.feasible is (expected_A is not None)
    assert decision.current_A == pytest.approx(expected_A or 0.0, rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "constant"),
    [
        ({}, 11.25),
        ({"core_temperature_K": (303.0, 0.0)}, 13.25),
        ({"coolant_temperature_K": (296.0, 0.0)}, 10.25),
        ({"cooling_power_W": 4.0}, 10.25),
        ({"cooling_power_W": -7.0}, None),
    ],
)
def test_the_surface_rides_what_its_equation_leaves(
    changes: dict[str, Any], constant: float | None
) -> None:
    """2 (Tc - Ts) + 0.5 (Tinf - Ts) + (limit - Ts) + P - 0.75 - u^2 is not below 0."""
    k = constants(alpha2_per_s=1e6, a1_per_s=1e6, a3_K_per_A2s=1e-6)
    k.max_core_temperature_K = (440.0, 0.0)
    k.max_surface_temperature_K = (304.0, 0.0)
    k.alpha3_per_s2, k.a10_K_per_Ws2, k.a9_K_per_A2s2 = 1.0, 1.0, -1.0
    k.a4_per_s2, k.a6_per_s2 = 2.0, 0.5
    k.delta4_K_per_s2, k.surface_margin_K_per_s2 = 0.5, 0.25
    known = {
        "core_temperature_K": (302.0, 0.0),
        "surface_temperature_K": (300.0, 0.0),
        "coolant_temperature_K": (298.0, 0.0),
        "cooling_power_W": 5.0,
    }
    decision = solve(k, state(300.0, **{**known, **changes}))
    if constant is None:
        assert (decision.feasible, decision.current_A) == (False, 0.0)
    else:
        assert decision.active == lib.RCBF_SURFACE
        assert decision.current_A == pytest.approx(-math.sqrt(constant), rel=1e-6)


@pytest.mark.parametrize("voltage_V", [math.nan, math.inf, -math.inf])
def test_an_open_circuit_voltage_that_is_no_number_admits_no_current(voltage_V: float) -> None:
    steadier = ffi.new("rcbf_steadier_t *")
    lib.rcbf_steadier_reset(steadier)
    given = ffi.new("rcbf_input_t *", state())
    decision = lib.rcbf_solve_steadily(constants(), given, voltage_V, steadier)
    if voltage_V == -math.inf:
        assert decision.feasible, "an empty cell has room without end"
    else:
        assert (decision.feasible, decision.current_A) == (False, 0.0)
        assert decision.lower_A == np.float32(LARGEST)


def test_a_constraint_that_overflows_admits_no_current() -> None:
    """Room without end and heat without end leave no number between them."""
    k = constants(alpha2_per_s=1e38, a1_per_s=1e38, a2_per_As=-1e37)
    decision = solve(k, state())
    assert (decision.feasible, decision.current_A) == (False, 0.0)
    assert decision.upper_A == np.float32(-LARGEST)
