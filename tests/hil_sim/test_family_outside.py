"""A cell outside of its family: it keeps its limits all the same, or the charge ends at 0 A."""

from __future__ import annotations

import pytest

from bms.presets import load_preset
from hil_sim.run.result import STOP_COMPLETE, STOP_FAULT
from hil_sim.studies.family_outside import OUTSIDE, charge_outside

PRESET = load_preset("a123_26650_10C")
VOLTAGE_IMPLAUSIBLE, CURRENT_DEVIATION = 12, 11


@pytest.mark.parametrize(
    ("case", "end", "fault"),
    [
        ("ohmic resistance x 3", STOP_COMPLETE, None),
        ("capacity x 0.5", STOP_FAULT, VOLTAGE_IMPLAUSIBLE),
        ("charger gives 30 % more", STOP_FAULT, CURRENT_DEVIATION),
        ("resistance core to surface x 1.5", STOP_COMPLETE, None),
    ],
)
def test_no_current_flows_beyond_a_limit(case: str, end: str, fault: int | None) -> None:
    outcome = charge_outside(PRESET, case, 313.0)
    assert outcome.charged_beyond_s == 0.0
    assert max(outcome.core_over_K, outcome.surface_over_K, outcome.voltage_over_V) <= 0.0
    assert (outcome.end, outcome.first_fault) == (end, fault)


def test_every_case_lies_outside_of_the_family_in_what_it_names() -> None:
    interval, supply = PRESET.cell.interval, PRESET.supply
    assert interval is not None
    for case, outside in OUTSIDE.items():
        factors = outside.factors
        beyond = []
        for name, bounds in vars(interval).items():
            if isinstance(bounds, tuple):
                beyond.append(not bounds[0] <= getattr(factors, name) <= bounds[1])
        beyond += [
            abs(factors.entropic_error_V_per_K) > interval.entropic_error_V_per_K,
            abs(factors.ocv_error_V) > interval.ocv_error_V,
            abs(outside.told_soc) > PRESET.plug_in.soc_error,
            abs(outside.supply_tolerance) > supply.tolerance,
            outside.supply_lag_s > supply.lag_s,
        ]
        assert sum(beyond) == 1, case
