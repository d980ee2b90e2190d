"""Claims of a family held on cells, chargers and sensors that are as bad as they may be.

The oracle integrates the physics (family_cell); the observer and the decision are the C code.
"""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from tests.firmware.family_cell import Bench, FamilyCode, Member, Surroundings, family_code
from tests.firmware.family_claims import (
    REST_S,
    Start,
    broken,
    charge,
    random_member,
    random_surroundings,
)

OLD = Member(resistance=2.0, polarisation=(2.0, 2.0), capacity=0.8)
HOT_INSIDE = Member(
    core_resistance=1.2, core_heat_capacity=1.2, surface_heat_capacity=1.2, resistance=0.8
)


@pytest.fixture(scope="module")
def code(tmp_path_factory: pytest.TempPathFactory) -> FamilyCode:
    return family_code(tmp_path_factory.mktemp("family"))


def start_of(kind: str, draw: random.Random) -> Start:
    surface_K = draw.uniform(275.0, 318.0)
    start = Start(draw.choice([draw.uniform(0.0, 0.3), draw.uniform(0.0, 0.97)]), surface_K)
    start = replace(start, told_error=draw.choice([-0.05, 0.0, 0.05]))
    if kind == "hot inside":
        core_excess_K = min(draw.uniform(0.0, 32.0), 322.9 - surface_K)
        return replace(start, core_excess_K=core_excess_K, coolant_excess_K=-draw.uniform(0.0, 9.0))
    if kind == "warm coolant":
        return replace(start, coolant_excess_K=min(draw.uniform(0.0, 10.0), 322.5 - surface_K))
    return start


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["a123_26650", "a123_26650_10C"])
@pytest.mark.parametrize("kind", ["at rest", "hot inside", "warm coolant", "lost frames", "paused"])
@pytest.mark.parametrize("seed", range(6))
def test_every_claim_holds(code: FamilyCode, preset: str, kind: str, seed: int) -> None:
    draw = random.Random(f"{preset} {kind} {seed}")
    around = random_surroundings(draw, 0.05 if kind == "lost frames" else 0.0)
    pauses = ((40.0, 0.2), (60.0, 3.0), (90.0, 30.0)) if kind == "paused" else ()
    own = code.of(preset)
    assert not broken(
        charge(own, random_member(own, draw), start_of(kind, draw), around, 200.0, pauses=pauses)
    )


def test_a_charge_that_begins_anew_under_current_is_not_full_at_once(code: FamilyCode) -> None:
    # The request goes off and on within 0.2 s; the charger still gives 8 A through an old cell.
    around = Surroundings(lag_s=1.0)
    worst = charge(code, OLD, Start(0.88, told_error=0.04), around, 60.0, pauses=((32.0, 0.2),))
    assert not broken(worst)


def test_what_a_charge_has_left_in_the_branches_is_not_taken_for_charge(code: FamilyCode) -> None:
    # 3 s after a charge the voltage is still high by some 50 mV.
    for soc in (0.6, 0.66, 0.7, 0.74, 0.9):
        start = Start(soc, told_error=0.05)
        worst = charge(code, OLD, start, Surroundings(), 60.0, pauses=((40.0, 3.0),))
        assert not broken(worst), soc


def test_a_core_below_its_surface_is_bounded_by_the_surface(code: FamilyCode) -> None:
    # A small, well coupled core beside a coolant that is warmer by 10 K, known to the kelvin.
    member = Member(core_resistance=0.8, core_heat_capacity=0.8, surface_resistance=0.8)
    bench = Bench(code, member, Start(coolant_excess_K=10.0).state())
    bench.observe()
    bench.family.core_is_known, bench.family.core_room_K = True, bench.core_room_K
    for _ in range(19):  # before a rest has told anything
        bench.run_period(0.0)
        bench.observe()
        bench.family.rest.count = 0
        assert bench.family.core_room_K <= bench.core_room_K


@pytest.mark.parametrize("excess_K", [0.0, 8.0, 24.0])
@pytest.mark.parametrize("coolant_K", [-12.0, 0.0, 10.0])
def test_rest_tells_a_core_that_is_no_cooler_than_it_is(
    code: FamilyCode, excess_K: float, coolant_K: float
) -> None:
    for member in (Member(), HOT_INSIDE, replace(HOT_INSIDE, surface_resistance=0.8)):
        start = Start(core_excess_K=excess_K, coolant_excess_K=coolant_K)
        worst_errors = Surroundings(errors=lambda time_s: (0.0, 0.0, -1.0, 1.0))
        bench = Bench(code, member, start.state(), worst_errors)
        known = []
        while bench.time_s < 3.0 * REST_S:
            bench.observe()
            if bench.family.core_is_known:
                known.append(bench.core_room_K - bench.family.core_room_K)
            bench.run_period(0.0)
        assert known and min(known) >= 0.0


def test_a_hot_core_waits_and_is_charged_when_it_has_cooled(code: FamilyCode) -> None:
    bench = Bench(code, HOT_INSIDE, Start(core_excess_K=26.0, coolant_excess_K=-15.0).state())
    first_s = None
    while bench.time_s < 200.0 and first_s is None:
        bench.observe()
        if bench.time_s > 0.3 and not bench.is_charging:
            bench.begin()
        command_A = bench.decide() if bench.is_charging else 0.0
        if command_A > 0.0:
            first_s = bench.time_s
            assert bench.family.core_is_known and bench.family.core_room_K > 0.0
        bench.run_period(command_A)
    assert first_s is not None and first_s > 2.0
