"""Each slip of the paper, put back into the constants, is seen."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from bms.model.pair import load_pair
from bms.presets.paper_form import in_paper_form
from bms.verification import CLASHING_DELTA4, SLIPS, Slip, verify
from bms.verification.closed_loop import SlipCost, slip_cost
from bms.verification.conditions import decided_conditions, firmware_constants, required_conditions
from bms.verification.slips import with_slips

BY_NAME: dict[str, Slip] = {slip.name: slip for slip in (*SLIPS, CLASHING_DELTA4)}
UNSAFE = [
    ("lin2014", "core-sign"),
    ("lin2014", "surface-error"),
    ("lin2014", "no-margins"),
    ("lin2014", "delta4-sign"),
    ("paper_calibrated", "coolant-capacity"),
]


@cache
def pair(name: str):
    preset, model = load_pair(name, None)
    return in_paper_form(preset), model


def constants(name: str, *slips: Slip) -> dict[str, Any]:
    preset, model = pair(name)
    return with_slips(preset, firmware_constants(preset, model), slips)


@cache
def lin2014_cost(*slips: Slip) -> SlipCost:
    return slip_cost(*pair("lin2014"), slips, certified=not slips, horizon_s=560.0)


@pytest.mark.parametrize(("preset", "slip"), UNSAFE)
def test_slips_that_take_safety_are_not_certified(preset, slip):
    assert not verify(*pair(preset), (BY_NAME[slip],), largest_boxes=50_000).certified


@pytest.mark.parametrize("slip", BY_NAME)
def test_every_slip_departs_from_the_conditions_that_must_hold(slip):
    """Without slip, decided and required differ by the margin and float32 alone."""

    def departures(values: dict[str, Any]) -> list[float]:
        required = required_conditions(pair("lin2014")[0])
        decided = decided_conditions(values)
        margins = values["core_margin_K_per_s"], values["surface_margin_K_per_s2"]
        found = []
        for need, have, margin in zip(required, decided, margins):
            for name in ("core_gap", "coolant_gap", "room", "coupling", "squared", "cooling"):
                a, b = getattr(need, name), getattr(have, name)
                found.append(abs(a - b) / max(abs(a), 1e-12))
            found.append(abs(need.reserve + margin - have.reserve))
            found.append(0.0 if len(have.branches()) == 2 else 1.0)
            found.append(0.0 if margin > 0.0 else 1.0)
        return found

    assert max(departures(constants("lin2014"))) < 1e-6
    assert max(departures(constants("lin2014", BY_NAME[slip]))) > 5e-5


def test_the_resistance_slip_is_safe_and_makes_charging_slower_by_half():
    slip = BY_NAME["a9-resistance"]

    ours, slow = lin2014_cost(), lin2014_cost(slip)

    assert verify(*pair("lin2014"), (slip,)).certified
    assert ours.charge_time_s is not None
    assert slow.charge_time_s is None or slow.charge_time_s > 1.5 * ours.charge_time_s
    assert max(slow.core_excess_K, slow.surface_excess_K, slow.voltage_excess_V) <= 0.0


def test_the_voltage_is_crossed_in_a_charge_without_margins_only():
    assert lin2014_cost().voltage_excess_V <= 0.0
    assert lin2014_cost(BY_NAME["no-margins"]).voltage_excess_V > 0.0
