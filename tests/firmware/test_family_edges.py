"""Rules of a family's observer that charges seldom meet, each from both sides."""

from __future__ import annotations

import math
from typing import Any

import pytest

from bms.firmware._firmware import ffi, lib
from tests.firmware.bench import Bench, Ecu
from tests.firmware.family_cell import FamilyCode, with_constants

PRESET = "a123_26650_10C"
CORE_OVER_TEMPERATURE, OUT_OF_DOMAIN = 14, 10
BRIDGED_PERIODS = 3
FULL = 0.8


@pytest.fixture(scope="module")
def code() -> FamilyCode:
    return with_constants(PRESET, ffi, lib)


def started(code: FamilyCode, told_soc: float = 0.5) -> Any:
    """An observer in a charge that has just begun, and a core that is known."""
    family, at_rest = code.observer(), code.reading()
    code.observe(family, at_rest)
    code.begin(family, told_soc, at_rest)
    family.core_is_known, family.core_room_K = True, 10.0
    return family


@pytest.mark.parametrize(
    ("known", "low", "missing_periods", "full"),
    [
        (True, FULL, 1, True),
        (True, FULL - 1e-6, 1, False),
        (False, FULL, 1, False),
        (False, 0.0, 0, True),
        (True, 0.0, 0, True),
    ],
)
def test_full_is_what_either_the_count_or_the_voltage_proves(
    code: FamilyCode, known: bool, low: float, missing_periods: int, full: bool
) -> None:
    family = started(code)
    family.soc_known, family.soc_low.soc = known, low
    family.full_count = code.k.full_periods - missing_periods
    assert lib.family_is_full(family, code.k, FULL) is full


@pytest.mark.parametrize(
    ("room_K", "current_errors", "known", "too_hot"),
    [
        (-2.1, 2.1, True, True),
        (-1.9, 2.1, True, False),
        (-2.1, 1.9, True, False),
        (-2.1, 2.1, False, False),
        (-2.1, -2.1, True, False),
    ],
)
def test_a_core_is_too_hot_where_it_is_known_and_current_flows(
    code: FamilyCode, room_K: float, current_errors: float, known: bool, too_hot: bool
) -> None:
    family = started(code)
    family.core_is_known, family.core_room_K = known, room_K
    reading = code.reading(current_A=-current_errors * code.k.current_error_A)
    assert lib.family_is_too_hot(family, code.k, code.cell, reading, 2.0) is too_hot


@pytest.mark.parametrize(("estimate_room_K", "used_K"), [(4.0, 4.0), (2.0, 3.0), (math.nan, 3.0)])
def test_an_estimate_that_somebody_vouches_for_is_believed_where_it_is_cooler(
    code: FamilyCode, estimate_room_K: float, used_K: float
) -> None:
    constants = ffi.new("family_constants_t *", code.k[0])
    constants.estimate_error_K = 0.5
    family = started(code)
    family.core_room_K = 3.0
    limit_K = code.cell.max_core_temperature_K.high_K + code.cell.max_core_temperature_K.low_K
    reading = code.reading(estimated_core_K=limit_K - estimate_room_K - 0.5, current_A=-1.0)
    hot = [
        lib.family_is_too_hot(family, constants, code.cell, reading, -used_K - beside_K)
        for beside_K in (-0.01, 0.01)
    ]
    assert hot == [False, True], "it takes an overshoot below the room that is used"


def test_without_readings_the_core_is_followed_for_three_periods_and_then_forgotten(
    code: FamilyCode,
) -> None:
    family, missing = started(code), code.reading(is_usable=False, command_A=-5.0)
    for _ in range(BRIDGED_PERIODS):
        before_K = family.core_room_K
        code.observe(family, missing)
        assert family.core_is_known and family.soc_known
        assert family.core_room_K < before_K, "it takes up what heat there can be"
    code.observe(family, missing)
    assert not family.core_is_known and not family.soc_known


def test_a_gap_that_ends_in_time_begins_anew(code: FamilyCode) -> None:
    family, missing = started(code), code.reading(is_usable=False)
    for _ in range(3):
        for _ in range(BRIDGED_PERIODS):
            code.observe(family, missing)
        code.observe(family, code.reading())
        assert family.core_is_known


@pytest.mark.parametrize(
    ("current_A", "is_charging", "known"),
    [(0.0, False, True), (2.0, False, False), (-2.0, False, False), (-2.0, True, True)],
)
def test_current_out_of_a_charge_makes_the_observer_forget(
    code: FamilyCode, current_A: float, is_charging: bool, known: bool
) -> None:
    family = started(code)
    code.observe(family, code.reading(current_A=current_A, is_charging=is_charging))
    assert family.core_is_known is known
    assert family.soc_known is known


@pytest.mark.parametrize("current_A", [-math.inf, -1e30])
def test_a_current_whose_heat_is_no_number_leaves_no_core_known(
    code: FamilyCode, current_A: float
) -> None:
    family = started(code)
    code.observe(family, code.reading(current_A=current_A))
    assert not family.core_is_known
    decision = code.decide(family, code.reading(), 5.0)
    assert (decision.feasible, decision.current_A) == (False, 0.0)


def room_after_window(code: FamilyCode, rise_K: float, gap_K: float) -> float:
    """Room of the core at the end of the periods that tell it, from a surface of 300 K."""
    family, periods = started(code), code.k.charge_periods
    family.charge = {"count": periods - 1, "first_K": 300.0, "gap_K": gap_K * periods}
    surface_K = 300.0 + rise_K
    readings = {"surface_temperature_K": surface_K, "coolant_temperature_K": surface_K}
    code.observe(family, code.reading(current_A=-1.0, **readings))
    assert family.charge.count == 0, "the window has ended"
    return float(family.core_room_K)


def test_a_surface_that_says_the_core_is_hotter_is_believed(code: FamilyCode) -> None:
    told_K = 323.0 - 300.0
    per_rise, per_gap = code.k.least_per_surface_rise, code.k.least_per_coolant_gap
    hottest_K = (0.01 + per_rise) * 12.0 + 20.0 * per_gap - code.k.charge_error_K
    assert hottest_K > told_K - 9.0, "that it is hotter than the 10 K of room say"
    assert room_after_window(code, 12.0, 20.0) == pytest.approx(told_K - hottest_K, abs=0.01)
    for rise_K, gap_K in ((0.0, 20.0), (12.0, -0.01), (-12.0, 20.0)):
        assert room_after_window(code, rise_K, gap_K) > 9.0, "a core no hotter, or another heat"


@pytest.mark.parametrize("rise_K", [-0.5, 0.5])
def test_a_rise_counts_with_the_least_and_a_fall_with_the_most(
    code: FamilyCode, rise_K: float
) -> None:
    k, gap_K = code.k, 60.0
    per_rise = k.least_per_surface_rise if rise_K > 0.0 else k.most_per_surface_fall
    mean_rise_K = rise_K / k.charge_periods
    hottest_K = 300.0 + mean_rise_K + rise_K * per_rise
    hottest_K += gap_K * k.least_per_coolant_gap - k.charge_error_K
    assert room_after_window(code, rise_K, gap_K) == pytest.approx(323.0 - hottest_K, abs=1e-3)


@pytest.mark.parametrize(("rise_K", "gap_K"), [(0.0, 0.0), (0.2, 3.0), (-0.2, 3.0), (0.2, -3.0)])
def test_at_rest_the_surface_tells_the_hottest_core(
    code: FamilyCode, rise_K: float, gap_K: float
) -> None:
    """No hotter than its mean, or than the surface; from the surface's own balance."""
    k, family, summed_K = code.k, code.observer(), 5.0
    periods = k.rest_periods
    window = {"count": periods - 1, "first_K": 300.0, "sum_K": summed_K, "gap_K": gap_K * periods}
    family.rest = window
    surface_K = 300.0 + rise_K
    at_rest = {"surface_temperature_K": surface_K, "coolant_temperature_K": surface_K}
    code.observe(family, code.reading(**at_rest))
    mean_K = 300.0 + (summed_K + rise_K) / periods
    above_K = max(rise_K, 0.0) * k.per_surface_rise + max(gap_K, 0.0) * k.per_coolant_gap
    heated_K = periods * k.heating_K_per_W * family.heat_W
    hottest_K = max(surface_K, mean_K + above_K) + k.rest_error_K + max(heated_K, 0.0)
    assert family.core_is_known and family.rest.count == 0
    assert family.core_room_K == pytest.approx(323.0 - hottest_K, abs=1e-3)


@pytest.mark.parametrize(("known_room_K", "told"), [(10.0, True), (22.0, False)])
def test_what_the_surface_tells_at_rest_is_believed_where_it_is_cooler(
    code: FamilyCode, known_room_K: float, told: bool
) -> None:
    """A surface that was 3 K warmer on average says less of the core than what is known already."""
    k, family = code.k, code.observer()
    family.rest = {"count": k.rest_periods - 1, "first_K": 300.0, "sum_K": 3.0 * k.rest_periods}
    family.core_is_known, family.core_room_K = True, known_room_K
    at_rest = {"surface_temperature_K": 300.0, "coolant_temperature_K": 300.0}
    code.observe(family, code.reading(**at_rest))
    told_K = 323.0 - (303.0 + k.rest_error_K + k.rest_periods * k.heating_K_per_W * family.heat_W)
    assert 10.0 < told_K < 22.0
    assert family.core_room_K == pytest.approx(told_K if told else known_room_K, abs=0.2)


@pytest.mark.parametrize("current_A", [0.0, 3.0])
def test_no_current_and_a_load_raise_no_voltage(code: FamilyCode, current_A: float) -> None:
    family, deviation_V = started(code), 0.01
    ocv_V = lib.rcbf_open_circuit_voltage_V(code.cell, family.soc_high.soc)
    highest_V = ocv_V + family.resistance_ohm * code.k.current_error_A + family.polarisation_V
    highest_V += code.k.ocv_error_V + family.rest_polarisation_V + deviation_V
    for beside_V, plausible in ((-2e-4, True), (2e-4, False)):
        reading = code.reading(current_A=current_A, voltage_V=highest_V + beside_V)
        given = (family, code.k, code.cell, reading, deviation_V)
        assert lib.family_voltage_is_plausible(*given) is plausible


@pytest.mark.parametrize("beyond", [0.9, 1.1])
def test_only_a_cell_at_rest_is_asked_by_its_voltage_how_full_it_is(
    code: FamilyCode, beyond: float
) -> None:
    family, told, error = code.observer(), 0.5, float(code.k.plug_in_error)
    current_A = 2.0 * code.k.current_error_A * beyond
    code.begin(family, told, code.reading(voltage_V=2.9, current_A=-current_A))
    low, high = family.soc_low.soc, family.soc_high.soc
    if beyond > 1.0:
        assert (low, high) == pytest.approx((told - error, told + error))
    else:
        assert low < told - error, "a voltage that contradicts what is told widens the bounds"


def test_who_asks_for_what_is_allowed_gets_it(code: FamilyCode) -> None:
    """However the limit is rounded: the current that rides the core's is never infeasible."""
    riding = 0
    for step in range(300):
        family, reading = started(code), code.reading(current_A=-8.0, voltage_V=3.0)
        code.observe(family, reading)
        family.core_room_K = 2.0 + 0.005 * step
        most = code.decide(family, reading, 23.0)
        again = code.decide(family, reading, -most.current_A)
        riding += most.active == lib.RCBF_CORE
        assert most.feasible and again.feasible
        assert again.current_A == pytest.approx(most.current_A, rel=1e-6)
    assert riding > 200


ROUNDED_BESIDE_THE_LIMIT = [
    (1.9122077226638794, 319.6938781738281, 309.0435485839844, -2.0331830978393555, 3.4024637),
    (1.163733720779419, 319.3653869628906, 305.69610595703125, -4.747109413146973, 3.4557192),
    (1.0303840637207031, 317.6961975097656, 295.70648193359375, -3.15012264251709, 3.4388979),
]


@pytest.mark.parametrize("values", ROUNDED_BESIDE_THE_LIMIT)
def test_a_rounding_at_the_limit_of_the_core_is_not_taken_for_beyond(
    code: FamilyCode, values: tuple[float, ...]
) -> None:
    """Where the heat left at the allowed strength comes out a little below 0, found by search."""
    family, names = started(code), ("surface_temperature_K", "coolant_temperature_K")
    temperatures = dict(zip(names, values[1:3]))
    reading = code.reading(**temperatures, current_A=values[3], voltage_V=values[4])
    code.observe(family, reading)
    family.core_room_K = values[0]
    most = code.decide(family, reading, 23.0)
    again = code.decide(family, reading, -most.current_A)
    assert (most.active, again.active) == (lib.RCBF_CORE, lib.RCBF_NONE)
    assert again.current_A == pytest.approx(most.current_A, rel=1e-6)
    assert -1e-7 < again.margins[2] < 0.0


def test_a_charger_may_lag_by_two_periods_when_it_is_told_less(code: FamilyCode) -> None:
    """Commands of three periods bound what it supplies; then it goes its slowest way down."""
    family, highs = code.observer(), []
    for command_A in (-5.0, -1.0, -1.0, -1.0):
        code.observe(family, code.reading(command_A=command_A))
        highs.append(family.supply_high_A)
    assert highs[:3] == [5.0, 5.0, 5.0]
    assert highs[3] == pytest.approx(5.0 - code.k.supply_share * 4.0, rel=1e-6)


def test_and_when_it_is_told_more(code: FamilyCode) -> None:
    family, lows = code.observer(), []
    for command_A in (0.0, -5.0, -5.0, -5.0):
        code.observe(family, code.reading(command_A=command_A))
        lows.append(family.supply_low_A)
    assert lows[:3] == [0.0, 0.0, 0.0]
    assert lows[3] == pytest.approx(code.k.supply_share * 5.0, rel=1e-6)


def test_every_branch_follows_the_current_between_its_slowest_and_its_fastest(
    code: FamilyCode,
) -> None:
    family, branches, error_A = started(code), code.k.branches, code.k.current_error_A
    assert branches >= 2
    code.observe(family, code.reading(current_A=-4.0))
    code.observe(family, code.reading(current_A=-4.0))
    for i in range(branches):
        branch, most_A = code.k.branch[i], 4.0 + error_A
        # The cell has rested for a period, in which the error alone may have flowed.
        strong_A = most_A - (most_A - branch.fast * error_A) * (1.0 - branch.fast) ** 2
        # At the first reading the current has been between 0 A and 4 A.
        weak_A = branch.slow * (4.0 - error_A)
        assert family.strong_A[i] == pytest.approx(strong_A, rel=1e-5)
        assert family.weak_A[i] == pytest.approx(weak_A, rel=1e-5)


def test_of_an_unknown_charge_the_emptiest_is_assumed_for_the_heat(code: FamilyCode) -> None:
    family, voltage_V = code.observer(), 3.3
    code.observe(family, code.reading(voltage_V=voltage_V))
    empty_V = code.cell.ocv_V[0]
    errors_V = code.k.ocv_error_V + code.k.voltage_error_V + 2.0 * family.rest_polarisation_V
    assert family.overpotential_V == pytest.approx(voltage_V - empty_V + errors_V, abs=1e-5)


@pytest.mark.parametrize("net_W", [-5.0, -0.3, 0.3])
def test_a_core_warms_as_the_lightest_and_cools_as_the_heaviest(
    code: FamilyCode, net_W: float
) -> None:
    k, family, reading = code.k, started(code), code.reading(current_A=-4.0)
    code.observe(family, reading)
    before_W, strength_A = family.heat_W, 4.0 + k.current_error_A
    limit_K = code.cell.max_core_temperature_K.high_K + code.cell.max_core_temperature_K.low_K
    surface_room_K = limit_K - 298.0 - k.surface_error_K
    disturbance_W = k.disturbance_W + strength_A * (
        k.disturbance_W_per_A + strength_A * k.disturbance_W_per_A2
    )
    gained_W = before_W + disturbance_W
    family.core_room_K = surface_room_K - (gained_W - net_W) / k.outflow_W_per_K
    room_K = family.core_room_K
    code.observe(family, reading)
    heavier_or_lighter = k.heating_K_per_W if net_W > 0.0 else k.cooling_K_per_W
    assert family.heat_W == pytest.approx(before_W, abs=0.05), "the readings are the same"
    moved_K = heavier_or_lighter * (net_W + max(family.heat_W - before_W, 0.0))
    assert room_K - family.core_room_K == pytest.approx(moved_K, abs=2e-5)


def family_bench() -> Bench:
    bench = Bench(ecu=Ecu(PRESET))
    bench.follow_command = False
    return bench


def faults_of(bench: Bench) -> set[int]:
    active = int(bench.answer["ActiveFaults"])
    return {number for number in range(21) if active >> number & 1}


def charging_bench() -> Bench:
    bench = family_bench()
    for _ in range(40):
        bench.period(Request=0, Voltage=3.3)
    for _ in range(10):
        bench.period(Request=1)
    assert bench.state in ("Charging", "Derated")
    return bench


def test_a_family_needs_no_estimate_within_its_training() -> None:
    bench = charging_bench()
    bench.period(CoolingPower=9.0)
    assert bench.answer["InDomain"] == 0
    assert OUT_OF_DOMAIN not in faults_of(bench)


@pytest.mark.parametrize("room_K", [-50.0, 5.0])
def test_current_into_a_core_that_is_too_hot_is_a_fault(room_K: float) -> None:
    bench = charging_bench()
    bench.ecu._state.family.core_is_known = True
    bench.ecu._state.family.core_room_K = room_K
    bench.period(Current=-2.0)
    assert (CORE_OVER_TEMPERATURE in faults_of(bench)) is (room_K < 0.0)


def test_a_core_that_is_too_hot_waits_without_a_fault_out_of_a_charge() -> None:
    bench = family_bench()
    for _ in range(4):
        bench.period(Request=0, Voltage=3.3)
    bench.ecu._state.family.core_is_known = True
    bench.ecu._state.family.core_room_K = -50.0
    bench.period(Current=-2.0)
    assert CORE_OVER_TEMPERATURE not in faults_of(bench)


@pytest.mark.parametrize(
    ("drop", "changes"),
    [
        (("CellElectrical",), {}),
        (("CellThermal",), {}),
        ((), {"Current": 100.0}),
        ((), {"Voltage": 5.0}),
        ((), {"SurfaceTemperature": 400.0}),
        ((), {"CoolantTemperature": 400.0}),
    ],
)
def test_what_is_missing_or_out_of_range_is_bridged_by_the_observer(
    drop: tuple[str, ...], changes: dict[str, float]
) -> None:
    bench = charging_bench()
    assert bench.ecu._state.family.bridged == 0
    bench.period(drop, **changes)
    assert bench.ecu._state.family.bridged == 1


def test_a_family_whose_core_is_not_known_gets_no_current() -> None:
    """Nor does the decision for one cell take the place of its own."""
    bench = charging_bench()
    bench.ecu._state.family.core_is_known = False
    bench.period(Current=-2.0)
    assert (bench.state, bench.command_A) == ("Derated", 0.0)
    assert bench.answer["ActiveConstraint"] == lib.RCBF_CORE_UNKNOWN
