"""Claims of a family broken on purpose in C: each must be noticed on an independent plant.

Every scenario keeps all claims on the code as it is (the first test), and breaks the named one on a
mutant.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import pytest

from tests.firmware.family_cell import Bench, FamilyCode, Member, Surroundings, family_code
from tests.firmware.family_claims import Start, broken, charge

OLD = Member(resistance=2.0, polarisation=(2.0, 2.0), relaxation=(1 / 1.5, 1 / 1.5), capacity=0.8)
SLOW = Member(
    core_resistance=1.2,
    core_heat_capacity=0.8,
    surface_resistance=1.2,
    resistance=2.0,
    polarisation=(0.0, 0.0),
    entropic_error_V_per_K=2e-5,
    ocv_error_V=-0.01,
)
LOW_READINGS = Surroundings(errors=lambda time_s: (1.0, -1.0, -1.0, 1.0), supply_factor=1.05)
HIGH_READINGS = Surroundings(errors=lambda time_s: (-1.0, 1.0, 1.0, -1.0), supply_factor=1.05)


def _hot_charge(code: FamilyCode, member: Member = SLOW) -> dict[str, float]:
    start = Start(0.15, 313.0, told_error=0.05)
    return charge(code, member, start, LOW_READINGS, 250.0, is_core_told=True)


def _new_and_hot(code: FamilyCode) -> dict[str, float]:
    start, member = Start(0.15, 318.0, told_error=0.05), replace(SLOW, resistance=1.0)
    around = replace(LOW_READINGS, lag_s=1.0)
    return charge(code, member, start, around, 200.0, is_core_told=True)


def _top(code: FamilyCode) -> dict[str, float]:
    return charge(code, OLD, Start(0.9, told_error=-0.05), LOW_READINGS, 200.0)


def _cold(code: FamilyCode) -> dict[str, float]:
    return charge(code, OLD, Start(0.5, 279.0, told_error=0.05), LOW_READINGS, 60.0)


def _new_told_too_much(code: FamilyCode) -> dict[str, float]:
    member = Member(resistance=2.0, polarisation=(2.0, 2.0), ocv_error_V=0.01)
    return charge(code, member, Start(0.85, told_error=0.05), HIGH_READINGS, 400.0)


def _toggled(code: FamilyCode) -> dict[str, float]:
    around = Surroundings(lag_s=1.0)
    return charge(code, OLD, Start(0.88, told_error=0.04), around, 60.0, pauses=((32.0, 0.2),))


def _paused(code: FamilyCode) -> dict[str, float]:
    worst: dict[str, float] = {}
    for soc in (0.03, 0.06, 0.09, 0.12):
        start = Start(soc, told_error=0.05)
        one = charge(code, OLD, start, Surroundings(), 60.0, pauses=((40.0, 3.0),))
        worst = {claim: max(by, worst.get(claim, by)) for claim, by in one.items()}
    return worst


def _warm_coolant(code: FamilyCode) -> dict[str, float]:
    member = Member(core_resistance=0.8, core_heat_capacity=0.8, surface_resistance=0.8)
    bench = Bench(code, member, Start(coolant_excess_K=10.0).state())
    bench.observe()
    bench.family.core_is_known, bench.family.core_room_K = True, bench.core_room_K
    worst = 0.0
    for _ in range(60):
        bench.run_period(0.0)
        bench.observe()
        bench.family.rest.count = 0
        worst = max(worst, bench.family.core_room_K - bench.core_room_K)
    return {"core is no hotter": worst}


def _hot_inside(code: FamilyCode) -> dict[str, float]:
    member = Member(core_resistance=1.2, core_heat_capacity=1.2, surface_heat_capacity=1.2)
    return charge(code, member, Start(0.3, 300.0, 22.0, -10.0), LOW_READINGS, 20.0)


def _lost(code: FamilyCode) -> dict[str, float]:
    around = replace(
        LOW_READINGS, is_lost=lambda period: period > 60 and period % 8 in (5, 6), lag_s=1.0
    )
    return charge(
        code, replace(OLD, resistance=2.0), Start(0.05, 305.0, told_error=-0.05), around, 200.0
    )


SCENARIOS: Mapping[str, Callable[[FamilyCode], dict[str, float]]] = MappingProxyType(
    {
        "hot charge": _hot_charge,
        "new and hot": _new_and_hot,
        "top": _top,
        "cold": _cold,
        "told too much": _new_told_too_much,
        "toggled": _toggled,
        "paused": _paused,
        "warm coolant": _warm_coolant,
        "hot inside": _hot_inside,
        "lost": _lost,
    }
)


@dataclass(frozen=True)
class Mutant:
    """One replacement in one source, the scenario and the claim that it breaks there."""

    source: str
    old: str
    new: str
    scenario: str
    claim: str


BEGIN, OBSERVER = "family_begin.c", "family_observer.c"
DECISION, TABLES = "family_decision.c", "family_tables.c"
MUTANTS = [
    Mutant(BEGIN, "if (family_is_at_rest(constants, reading)) {\n        /* A charge", "if (true) {\n        /* A charge", "toggled", "full is full"),
    Mutant(BEGIN, " - error_V - family->polarisation_V", " - error_V", "paused", "charge is no less"),
    Mutant(OBSERVER, "numeric_smaller(family->core_room_K, surface_room_K);", "family->core_room_K;", "warm coolant", "core is no hotter"),
    Mutant(OBSERVER, "? constants->heating_K_per_W :", "? constants->cooling_K_per_W :", "hot charge", "core is no hotter"),
    Mutant(OBSERVER, "family->resistance_ohm * at_most_A -\n        family->polarisation_V", "family->resistance_ohm * at_most_A", "told too much", "full is full"),
    Mutant(OBSERVER, "- family->resistance_ohm * at_most_A", "- constants->least_resistance_ohm * at_most_A", "told too much", "full is full"),
    Mutant(OBSERVER, "most_A * constants->greatest_soc_per_A", "most_A * constants->least_soc_per_A", "top", "charge is no more"),
    Mutant(OBSERVER, "least_A * constants->least_soc_per_A", "most_A * constants->greatest_soc_per_A", "told too much", "charge is no less"),
    Mutant(OBSERVER, "soc_add(&family->soc_high, strength_A * constants->greatest_soc_per_A);", "", "lost", "charge is no more"),
    Mutant("family_windows.c", " * constants->per_surface_rise +", " * 0.0f +", "hot inside", "core is no hotter"),
    Mutant(DECISION, "- constants->voltage_error_V - above_reading_V;", "+ 0.01f;", "top", "voltage"),
    Mutant(DECISION, "const float current_A = -allowed_A / factor;", "const float current_A = -allowed_A;", "cold", "voltage"),
    Mutant(TABLES, "return past_A * heat->overpotential_V +", "return 0.8f * past_A * heat->overpotential_V +", "hot charge", "core is no hotter"),
    Mutant(OBSERVER, "    family->core_room_K -=\n        ((net_W", "    family->core_room_K -=\n        0.0f * ((net_W", "new and hot", "core is no hotter"),
]  # fmt: skip


@pytest.fixture(scope="module")
def code(tmp_path_factory: pytest.TempPathFactory) -> FamilyCode:
    return family_code(tmp_path_factory.mktemp("family"))


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_code_as_it_is_keeps_every_claim(code: FamilyCode, scenario: str) -> None:
    assert not broken(SCENARIOS[scenario](code))


@pytest.mark.slow
@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda m: f"{m.scenario}: {m.new or m.old}"[:60])
def test_a_broken_claim_is_noticed(mutant: Mutant, tmp_path: Path) -> None:
    code = family_code(tmp_path, change=(mutant.source, mutant.old, mutant.new))
    assert mutant.claim in broken(SCENARIOS[mutant.scenario](code))
