"""The current that a family's firmware allows, constraint by constraint."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tests.firmware.family_cell import FamilyCode, family_code

LIMIT_V, LIMIT_K = 3.6, 323.0
READINGS = ("current_A", "voltage_V", "surface_temperature_K", "coolant_temperature_K")


@pytest.fixture(scope="module")
def code(tmp_path_factory: pytest.TempPathFactory) -> FamilyCode:
    return family_code(tmp_path_factory.mktemp("family"))


def known(
    code: FamilyCode, room_K: float = 20.0, soc: float = 0.5, **values: Any
) -> tuple[Any, Any]:
    """An observer that knows core and charge, and the readings it was told last."""
    family, at_rest = code.observer(), code.reading()
    code.observe(family, at_rest)
    code.begin(family, soc, at_rest)
    reading = code.reading(**values)
    for _ in range(3):
        code.observe(family, reading)
    family.core_is_known, family.core_room_K = True, room_K
    return family, reading


def active(code: FamilyCode, decision: Any) -> str:
    return str(code.ffi.string(code.ffi.cast("rcbf_active_t", decision.active)))


def test_what_is_safe_is_given_but_for_what_the_charger_adds(code: FamilyCode) -> None:
    decision = code.decide(*known(code), 2.0)
    assert decision.feasible and active(code, decision) == "RCBF_NONE"
    assert decision.current_A == pytest.approx(-2.0)


@pytest.mark.parametrize("name", READINGS)
def test_a_reading_that_is_no_number_gives_no_current(code: FamilyCode, name: str) -> None:
    family, reading = known(code)
    setattr(reading, name, math.nan)
    code.observe(family, reading)
    assert code.decide(family, reading, 5.0).current_A == 0.0


@pytest.mark.parametrize("asked_A", [math.nan, math.inf, -1.0])
def test_a_reference_that_makes_no_charge_gives_no_current(
    code: FamilyCode, asked_A: float
) -> None:
    decision = code.decide(*known(code), asked_A)
    assert decision.current_A == 0.0 and not decision.feasible
    assert active(code, decision) == "RCBF_INVALID"


def test_readings_that_are_not_usable_give_no_current(code: FamilyCode) -> None:
    family, reading = known(code)
    reading.is_usable = False
    assert not code.decide(family, reading, 5.0).feasible


def test_an_estimate_that_is_no_number_leaves_what_the_observer_knows(code: FamilyCode) -> None:
    family, reading = known(code)
    given = [code.decide(family, reading, 23.0).current_A]
    reading.estimated_core_K = 250.0
    given.append(code.decide(family, reading, 23.0).current_A)
    assert given[0] == given[1] < 0.0, "nobody vouches for the estimate of these presets"


def test_a_core_that_nobody_knows_waits(code: FamilyCode) -> None:
    family, reading = known(code)
    family.core_is_known = False
    decision = code.decide(family, reading, 5.0)
    assert decision.current_A == 0.0 and active(code, decision) == "RCBF_CORE_UNKNOWN"


@pytest.mark.parametrize(("room_K", "waits"), [(-1e-3, True), (0.0, False)])
def test_a_core_that_may_be_too_hot_waits(code: FamilyCode, room_K: float, waits: bool) -> None:
    cold = {"surface_temperature_K": 300.0, "coolant_temperature_K": 295.0}
    decision = code.decide(*known(code, room_K, **cold), 1.0)
    assert (decision.current_A == 0.0) is waits
    assert not waits or active(code, decision) == "RCBF_CORE"


def test_beside_a_coolant_that_is_too_hot_a_cell_waits(code: FamilyCode) -> None:
    given = []
    edge_K = LIMIT_K - code.k.coolant_error_K - code.k.inner_K
    for coolant_K in (edge_K - 0.01, edge_K + 0.01):
        given.append(code.decide(*known(code, coolant_temperature_K=coolant_K), 1.0).current_A)
    assert given[0] < 0.0 and given[1] == 0.0


def room_V(code: FamilyCode, family: Any, reading: Any, held_A: float) -> float:
    """Of the measured voltage to the limit, less its error and the drift within a hold."""
    k = code.k
    drift_V = family.ocv_slope_V * k.hold_soc_per_A * held_A
    drift_V += k.hold_s * k.rest_drift_per_s * family.rest_polarisation_V
    for i in range(k.branches):
        drift_V += k.hold_s * k.branch[i].drift_ohm_per_s * max(0.0, held_A - family.weak_A[i])
    return float(LIMIT_V - reading.voltage_V - k.voltage_error_V - drift_V)


def steadied_V(code: FamilyCode, periods: int) -> float:
    """Above a voltage that has held for some periods after it rose: half its error in the end.

    Per period 0.4 of what is left of the way; in the period of the rise it is what was read.
    """
    return float(0.5 * code.k.voltage_error_V * (1.0 - 0.6**periods))


@pytest.mark.parametrize("voltage_V", [3.45, 3.50, 3.62])
def test_the_voltage_follows_two_slopes(code: FamilyCode, voltage_V: float) -> None:
    family, reading = known(code, soc=0.95, current_A=-8.0, voltage_V=voltage_V, command_A=-8.0)
    family.supply_low_A = family.supply_high_A = 8.0
    k = code.k
    decision = code.decide(family, reading, 23.0)
    factor = min(1.0 + k.supply_tolerance, (8.0 + k.current_error_A) / 8.0)
    most_ohm = code.lib.family_resistance_ohm(k, 298.0 - k.surface_error_K)
    sure_V = room_V(code, family, reading, 23.0 * (1.0 + k.supply_tolerance))
    sure_V -= k.current_error_A * most_ohm + steadied_V(code, 2)
    slope_ohm = most_ohm if sure_V >= 0.0 else k.least_resistance_ohm
    expected_A = max(0.0, 8.0 + sure_V / slope_ohm)
    assert decision.current_A == pytest.approx(-expected_A / factor, rel=1e-3, abs=1e-3)
    assert active(code, decision) in ("RCBF_VOLTAGE",)


def test_a_current_out_of_the_cell_leaves_no_more_room_than_none(code: FamilyCode) -> None:
    """It has lowered the voltage already: nothing says that the charge will begin from there."""
    family, reading = known(code, soc=0.95, voltage_V=3.5)
    decisions = []
    for current_A in (0.0, 0.3, 0.9, 5.0):
        reading.current_A = current_A
        decisions.append(code.decide(family, reading, 23.0))
    assert {active(code, decision) for decision in decisions} == {"RCBF_VOLTAGE"}
    assert len({decision.current_A for decision in decisions}) == 1


def test_the_map_is_read_at_the_coldest_surface_and_the_fullest_cell(code: FamilyCode) -> None:
    own = code.of("a123_26650")
    family, reading = known(own, soc=0.85, surface_temperature_K=285.0)
    mapped_A = own.lib.family_mapped_A(
        own.ffi.addressof(own.k.map), 285.0 - own.k.surface_error_K, family.soc_high.soc
    )
    decision = own.decide(family, reading, 23.0)
    factor = 1.0 + own.k.supply_tolerance
    assert decision.current_A == pytest.approx(-mapped_A / factor, rel=1e-5)
    assert active(own, decision) == "RCBF_MAP"


@pytest.mark.parametrize(
    ("measured_A", "factor"), [(10.9, 1.05), (10.2, 1.02), (9.7, 0.97), (8.0, 0.95)]
)
def test_the_charger_is_taken_to_add_what_it_shows_at_most(
    code: FamilyCode, measured_A: float, factor: float
) -> None:
    own = code.of("a123_26650")
    measured_A -= own.k.current_error_A
    family, reading = known(own, current_A=-measured_A, command_A=-10.0, voltage_V=3.35)
    family.supply_low_A = family.supply_high_A = 10.0
    decision = own.decide(family, reading, 5.0)
    assert decision.lower_A == decision.current_A
    mapped = own.decide(family, reading, 23.0)
    # What is asked for is what is meant to flow at most: the command is the part that makes it.
    assert decision.current_A == pytest.approx(-5.0, rel=1e-5)
    assert mapped.current_A >= -10.0 / factor - 1e-3


@pytest.mark.parametrize(("excess_A", "believed"), [(-0.02, True), (0.02, False)])
def test_a_current_that_no_charger_makes_is_not_believed(
    code: FamilyCode, excess_A: float, believed: bool
) -> None:
    family, _ = known(code, current_A=-10.0, command_A=-10.0)
    family.supply_low_A = family.supply_high_A = 10.0
    deviation_A, tolerance = 0.5, code.k.supply_tolerance
    for strength_A in (
        10.0 * (1.0 + tolerance) + deviation_A + excess_A,
        10.0 * (1.0 - tolerance) - deviation_A - excess_A,
    ):
        plausible = code.lib.family_supply_is_plausible(family, code.k, -strength_A, deviation_A)
        assert plausible is believed
    assert not code.lib.family_supply_is_plausible(family, code.k, math.nan, deviation_A)


@pytest.mark.parametrize("voltage_V", [math.nan, 2.0, 4.1])
def test_a_voltage_that_no_cell_has_is_not_believed(code: FamilyCode, voltage_V: float) -> None:
    family, reading = known(code, current_A=-10.0, command_A=-10.0, voltage_V=3.45)
    believes = code.lib.family_voltage_is_plausible
    assert believes(family, code.k, code.cell, reading, 0.05)
    reading.voltage_V = voltage_V
    assert not believes(family, code.k, code.cell, reading, 0.05)


@pytest.mark.parametrize("periods", [9, 10])
def test_full_takes_its_periods_in_a_row(code: FamilyCode, periods: int) -> None:
    completion = code.preset.limits.completion_soc
    family, _ = known(code, soc=0.9)
    full = code.reading(voltage_V=3.59, current_A=-0.2)
    for _ in range(400):  # what was left at plug-in has gone
        code.observe(family, code.reading())
    for _ in range(periods):
        code.observe(family, full)
    assert code.lib.family_is_full(family, code.k, completion) is (periods >= code.k.full_periods)
    code.observe(family, code.reading())
    assert not code.lib.family_is_full(family, code.k, completion)
