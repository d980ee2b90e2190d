"""A surface sensor that sticks or drifts is found, and no limit is crossed meanwhile."""

from __future__ import annotations

import pytest

from hil_sim.faults import parse_fault
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

SURFACE_DEFICIT, OUT_OF_DOMAIN, CORE_TOO_HOT = 19, 10, 14


def charge(preset, since_s, drift_K_per_s=None, disturbance=DisturbanceKind.NONE):
    """A charge with a reading that drifts from a time on; without a drift it stays where it was."""
    fault = {"sensor": "surface_temperature_K", "from_s": since_s}
    if drift_K_per_s is None:
        fault |= {"kind": "sensor-stuck"}
    else:
        fault |= {"kind": "sensor-drifting", "rate_per_s": drift_K_per_s}
    faults = (parse_fault(fault, "test"),)
    return run_both(Settings(preset, disturbance=disturbance, faults=faults))


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
@pytest.mark.parametrize("since_s", [5.0, 300.0])
def test_a_sensor_that_drifts_cold_never_lets_a_limit_be_crossed(preset, since_s, drift_K_per_s):
    result = charge(preset, since_s, drift_K_per_s)
    assert result.summary.violations == ()
    assert result.summary.first_fault == SURFACE_DEFICIT
    # A kelvin and the prediction's bound, at the rate of the drift, and the debounce time.
    assert result.series.time_s[-1] <= since_s + 1.3 / -drift_K_per_s + 1.0


@pytest.mark.parametrize("drift_K_per_s", [None, -0.003])
def test_nor_when_every_disturbance_pushes_upward(preset, drift_K_per_s):
    """From the onset of derating on, where the core is at its limit."""
    result = charge(preset, 170.0, drift_K_per_s, DisturbanceKind.UPWARD)
    assert result.summary.violations == ()
    assert result.summary.first_fault == SURFACE_DEFICIT


def test_a_sensor_that_drifts_warm_only_costs_charge(preset):
    result = charge(preset, 5.0, 0.02)
    assert result.summary.violations == ()
    assert result.summary.first_fault in (CORE_TOO_HOT, OUT_OF_DOMAIN)
