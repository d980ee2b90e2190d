"""A surface sensor that sticks or drifts is found, and no limit is crossed meanwhile."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hil_sim.faults import parse_fault
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

SURFACE_DEFICIT, OUT_OF_DOMAIN, CORE_TOO_HOT = 19, 10, 14


def charge(preset, since_s, drift_K_per_s=None, disturbance=DisturbanceKind.NONE, start_K=None):
    """A charge with a reading that drifts from a time on; without a drift it stays where it was."""
    fault = {"sensor": "surface_temperature_K", "from_s": since_s}
    if drift_K_per_s is None:
        fault |= {"kind": "sensor-stuck"}
    else:
        fault |= {"kind": "sensor-drifting", "rate_per_s": drift_K_per_s}
    faults = (parse_fault(fault, "test"),)
    initial = preset.initial
    if start_K is not None:
        initial = replace(initial, temperature_K=start_K)
    return run_both(Settings(preset, initial=initial, disturbance=disturbance, faults=faults))


@pytest.mark.parametrize("since_s", [5.0, 120.0])
def test_a_sensor_that_sticks_while_the_cell_warms_ends_the_charge(any_preset, since_s):
    result = charge(any_preset, since_s)
    assert result.summary.violations == ()
    assert (result.summary.stop_reason, result.summary.first_fault) == (
        "fault",
        SURFACE_DEFICIT,
    )
    assert result.series.time_s[-1] < since_s + 45.0
    assert result.series.current_A[-1] == 0.0


@pytest.mark.parametrize("drift_K_per_s", [-0.003, -0.02, -0.3])
@pytest.mark.parametrize("since_s", [5.0, 100.0])
def test_a_sensor_that_drifts_cold_never_lets_a_limit_be_crossed(preset, since_s, drift_K_per_s):
    result = charge(preset, since_s, drift_K_per_s)
    assert result.summary.violations == ()
    assert result.summary.first_fault == SURFACE_DEFICIT
    # A kelvin and the prediction's bound, at the rate of the drift, and the debounce time.
    assert result.series.time_s[-1] <= since_s + 1.3 / -drift_K_per_s + 1.0


def test_a_sensor_that_sticks_while_every_disturbance_pushes_upward_ends_the_charge(preset):
    """From the onset of derating on, where the core is at its limit."""
    result = charge(preset, 170.0, disturbance=DisturbanceKind.UPWARD)
    assert result.summary.violations == ()
    assert result.summary.first_fault == SURFACE_DEFICIT


# Of the paper's cell the first is found during the charge, and the last not even disbelieved.
@pytest.mark.parametrize("drift_K_per_s", [-0.0011, -0.0008, -0.0003])
def test_nor_does_a_slow_drift_while_every_disturbance_pushes_upward(any_preset, drift_K_per_s):
    result = charge(any_preset, 5.0, drift_K_per_s, DisturbanceKind.UPWARD, start_K=313.0)
    assert result.summary.violations == ()
    assert result.summary.first_fault in (None, SURFACE_DEFICIT)


def test_a_sensor_that_drifts_warm_only_costs_charge(preset):
    result = charge(preset, 5.0, 0.02)
    assert result.summary.violations == ()
    assert result.summary.first_fault in (CORE_TOO_HOT, OUT_OF_DOMAIN)
