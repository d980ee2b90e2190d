"""Which constants the firmware takes: every number of them to its last good value and beyond it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from tests.firmware.test_envelope import put

LARGEST = float(np.finfo(np.float32).max)
LEAST_OF_CELL, LEAST = 1e-20, 2.0**-149
NAN, INFINITE = float("nan"), float("inf")
FAMILY_PRESET = "a123_26650_10C"

TEMPERATURE = (150.0, 450.0)
LOW_PART = (-450.0 * 2.0**-23, 450.0 * 2.0**-23)
POSITIVE, NOT_NEGATIVE = (LEAST_OF_CELL, LARGEST), (0.0, LARGEST)
ANY = (-LARGEST, LARGEST)
SHARE = (LEAST, 1.0)

CELL: dict[str, tuple[float, float]] = {
    "max_core_temperature_K.high_K": TEMPERATURE,
    "max_core_temperature_K.low_K": LOW_PART,
    "max_surface_temperature_K.high_K": TEMPERATURE,
    "max_surface_temperature_K.low_K": LOW_PART,
    **dict.fromkeys(
        "capacity_As ohmic_resistance_ohm max_voltage_V max_soc alpha1_per_s alpha2_per_s "
        "alpha3_per_s2 a1_per_s a3_K_per_A2s a10_K_per_Ws2".split(),
        POSITIVE,
    ),
    **dict.fromkeys(
        "delta4_K_per_s2 soc_uncertainty_per_s core_uncertainty_K_per_s estimation_error_bound_K "
        "voltage_margin_V soc_margin_per_s core_margin_K_per_s surface_margin_K_per_s2".split(),
        NOT_NEGATIVE,
    ),
    **dict.fromkeys("a2_per_As a8_per_As2 a4_per_s2 a6_per_s2".split(), ANY),
    "a9_K_per_A2s2": (-LARGEST, -LEAST_OF_CELL),
}
FAMILY: dict[str, tuple[float, float]] = {
    **dict.fromkeys(
        "least_soc_per_A greatest_soc_per_A hold_soc_per_A coldest_K per_step_K core_K_per_J "
        "heating_K_per_W cooling_K_per_W coldest_core_K hold_s period_s full_ocv_V "
        "estimate_error_K".split(),
        (LEAST, LARGEST),
    ),
    **dict.fromkeys(
        "plug_in_error ocv_error_V polarisation_ohm rest_polarisation_V rest_drift_per_s inner_K "
        "disturbance_W disturbance_W_per_A disturbance_W_per_A2 hold_W per_surface_rise "
        "per_coolant_gap rest_error_K least_per_surface_rise most_per_surface_fall "
        "least_per_coolant_gap charge_error_K current_error_A voltage_error_V surface_error_K "
        "coolant_error_K branch.0.resistance_ohm branch.0.drift_ohm_per_s map.strength_A.0".split(),
        NOT_NEGATIVE,
    ),
    **dict.fromkeys("supply_share relaxation branch.0.slow branch.0.fast".split(), SHARE),
    "supply_tolerance": (0.0, float(np.nextafter(np.float32(1.0), np.float32(0.0)))),
    **dict.fromkeys(["ocv_slope_V.31", "entropic_V_per_K.0", "entropic_V_per_K.31"], ANY),
}
PLANNER: dict[str, tuple[float, float]] = {
    "period_s": (LEAST, NAN),
    "step_s": (NAN, LARGEST),
    **dict.fromkeys(["growth_A", "completion_soc"], (LEAST, LARGEST)),
    **dict.fromkeys(["response.0", "response.14"], ANY),
}
THERMAL: dict[str, tuple[float, float]] = {
    **dict.fromkeys(["transition.0", "transition.3", "gain_K_per_W.1", "gain_coolant.0"], ANY),
    **dict.fromkeys(["ohmic_resistance_ohm", "entropic_coefficient_V_per_K"], ANY),
    "error_bound_K": NOT_NEGATIVE,
}
PARTS: dict[str, tuple[str, dict[str, tuple[float, float]]]] = {
    "rcbf": ("rcbf_constants_are_valid", CELL),
    "family": ("family_constants_are_valid", FAMILY),
    "planner": ("planner_constants_are_valid", PLANNER),
    "thermal": ("thermal_constants_are_valid", THERMAL),
}
Change = Callable[[Any], None]


@cache
def shipped() -> Any:
    """The calibration of a preset that states a family, of which tests change copies."""
    return Ecu(FAMILY_PRESET)._calibration[0]


def copy_of(part: str) -> Any:
    block = ffi.new("bms_calibration_t *", shipped())
    return block, ffi.addressof(block, part)


def takes(part: str, change: Change) -> bool:
    """Whether a part is valid after a change; the whole calibration is not without it."""
    block, constants = copy_of(part)
    change(constants)
    is_valid = bool(getattr(lib, PARTS[part][0])(constants))
    assert is_valid or not lib.calibration_is_valid(block)
    return is_valid


def set_path(constants: Any, path: str, value: float) -> None:
    *parts, last = path.split(".")
    for name in parts:
        constants = constants[int(name)] if name.isdigit() else getattr(constants, name)
    if last.isdigit():
        constants[int(last)] = value
    else:
        setattr(constants, last, value)


def bounded() -> Iterator[Any]:
    for part, (_, members) in PARTS.items():
        for path, bounds in members.items():
            yield pytest.param(part, path, bounds, id=f"{part}.{path}")


def put_value(path: str, value: float) -> Change:
    return lambda constants: set_path(constants, path, value)


@pytest.mark.parametrize("part", PARTS)
def test_the_shipped_constants_are_taken(part: str) -> None:
    assert takes(part, lambda _: None)


@pytest.mark.parametrize(("part", "path", "bounds"), list(bounded()))
def test_a_number_is_taken_up_to_its_bounds_and_not_beyond(
    part: str, path: str, bounds: tuple[float, float]
) -> None:
    for bound, beyond in zip(bounds, (-INFINITE, INFINITE)):
        if not np.isnan(bound):
            at = np.float32(bound)
            assert takes(part, put_value(path, float(at))), at
            with np.errstate(over="ignore"):
                next_one = float(np.nextafter(at, np.float32(beyond)))
            assert not takes(part, put_value(path, next_one)), next_one
        assert not takes(part, put_value(path, beyond))
    assert not takes(part, put_value(path, NAN))


def several(first: Change | None = None, **values: Any) -> Change:
    def change(constants: Any) -> None:
        if first is not None:
            first(constants)
        for path, value in values.items():
            set_path(constants, path.replace("__", "."), value)

    return change


def table(points: int, name: str, wrong: int | None = None) -> Change:
    """Tables that rise up to `points`, but for a step of one that does not."""

    def change(constants: Any) -> None:
        constants.ocv_points = points
        for column in (constants.ocv_soc, constants.ocv_V):
            for i in range(min(points, 64)):
                column[i] = 0.01 * i
        if wrong is not None:
            column = getattr(constants, name)
            column[wrong] = column[wrong - 1]

    return change


@pytest.mark.parametrize(
    ("change", "taken"),
    [
        (table(1, "ocv_V"), False),
        (table(2, "ocv_V"), True),
        (table(64, "ocv_V"), True),
        (several(ocv_points=65), False),
        (several(ocv_points=0), False),
        (table(9, "ocv_soc", 8), False),
        (table(9, "ocv_soc", 9), True),
        (table(9, "ocv_V", 8), False),
        (table(9, "ocv_V", 9), True),
        (several(ocv_soc__3=NAN), False),
        (several(ocv_V__3=INFINITE), False),
    ],
)
def test_the_table_of_voltages_rises_within_its_room(change: Change, taken: bool) -> None:
    assert takes("rcbf", change) is taken


def flat_map(temperatures: int, charges: int) -> Change:
    def change(family: Any) -> None:
        family.map.temperatures, family.map.charges = temperatures, charges
        for i in range(8):
            family.map.temperature_K[i], family.map.soc[i] = 273.0 + i, 0.1 * i
        for i in range(64):
            family.map.strength_A[i] = 1.0

    return change


@pytest.mark.parametrize(
    ("change", "taken"),
    [
        (flat_map(2, 2), True),
        (flat_map(8, 8), True),
        (flat_map(1, 2), False),
        (flat_map(9, 2), False),
        (flat_map(2, 1), False),
        (flat_map(2, 9), False),
        (several(map__temperature_K__1=100.0), False),
        (several(map__soc__1=-1.0), False),
        (several(rest_periods=0), False),
        (several(rest_periods=1), True),
        (several(charge_periods=0), False),
        (several(charge_periods=1), True),
        (several(full_periods=0), False),
        (several(full_periods=1), True),
        (several(branches=4), False),
        (several(branches=0), True),
        (several(outflow_W_per_K=0.0), False),
        (several(outflow_W_per_K=2.0, gain_W_per_K=2.0), True),
        (several(outflow_W_per_K=2.0, gain_W_per_K=1.99), False),
        (several(gain_W_per_K=INFINITE), False),
        (several(resistance_ohm__11=1.0), False),
        (several(resistance_ohm__11=0.0), False),
        (several(resistance_ohm__0=NAN), False),
        (several(resistance_ohm__0=LARGEST), True),
        (several(least_resistance_ohm=0.0), False),
        (several(is_stated=0, period_s=NAN, full_periods=0), True),
    ],
)
def test_counts_and_tables_of_a_family(change: Change, taken: bool) -> None:
    assert takes("family", change) is taken


@pytest.mark.parametrize("last", range(3))
def test_each_branch_of_a_family_is_looked_at(last: int) -> None:
    branch = {"slow": 0.1, "fast": 0.2, "resistance_ohm": 0.0, "drift_ohm_per_s": 0.0}

    def change(family: Any) -> None:
        family.branches = last + 1
        for i in range(last + 1):
            family.branch[i] = branch

    assert takes("family", change)
    for name in branch:
        assert not takes("family", several(change, **{f"branch__{last}__{name}": -1.0}))


@pytest.mark.parametrize(
    ("change", "taken"),
    [
        (several(period_s=1.0, step_s=1.0), True),
        (several(period_s=1.0, step_s=0.99), False),
        (several(period_s=INFINITE, step_s=INFINITE), False),
    ],
)
def test_a_planner_does_not_step_finer_than_the_period(change: Change, taken: bool) -> None:
    assert takes("planner", change) is taken


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("current_A", 0.0),
        ("voltage_V", 2.0),
        ("surface_temperature_K", 300.0),
        ("coolant_temperature_K", 300.0),
        ("cooling_power_W", 0.0),
    ],
)
def test_a_range_of_readings_is_not_empty(path: str, value: float) -> None:
    block = ffi.new("bms_calibration_t *", shipped())
    limits = getattr(block.plausibility, path)
    limits.low, limits.high = value, value
    assert not lib.calibration_is_valid(block)
    limits.high = float(np.nextafter(np.float32(value), np.float32(INFINITE)))
    if path == "current_A":
        limits.high, limits.low = value, -limits.high
    assert lib.calibration_is_valid(block)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("layout", 4),
        ("layout", 6),
        ("kan.width.0", 3),
        ("kan.output_center_K", NAN),
        ("rcbf.ocv_V.-1", 4.7),
        ("rcbf.ocv_V.0", -0.1),
    ],
)
def test_what_belongs_to_the_whole_is_looked_at(path: str, value: float) -> None:
    block = ffi.new("bms_calibration_t *", shipped())
    assert lib.calibration_is_valid(block)
    put(block, path, value)
    assert not lib.calibration_is_valid(block)
