"""A surface sensor that sticks or drifts is found, and no limit is crossed meanwhile."""

from __future__ import annotations

import pytest

from hil_sim.disturbances import DisturbanceKind
from hil_sim.sensors import Readings, SensorSuite
from hil_sim.session import Settings, run_both

SURFACE_DEFICIT, OUT_OF_DOMAIN, CORE_TOO_HOT = 19, 10, 14
BUS_STEP_K = 0.005


class FailingSurfaceSensor(SensorSuite):
    """From `since_s` on the reading drifts; without a drift it stays where it was."""

    since_s = 0.0
    drift_K_per_s: float | None = None
    period_s = 0.1

    def __init__(self, *arguments) -> None:
        super().__init__(*arguments)
        self._time_s = 0.0
        self._last_K = 0.0

    def read(self, truth: Readings) -> Readings:
        readings = super().read(truth)
        self._time_s += self.period_s
        if self._time_s < self.since_s:
            self._last_K = readings.surface_temperature_K
            return readings
        if self.drift_K_per_s is None:
            return readings._replace(surface_temperature_K=self._last_K)
        off_K = self.drift_K_per_s * (self._time_s - self.since_s)
        wrong_K = BUS_STEP_K * round((readings.surface_temperature_K + off_K) / BUS_STEP_K)
        return readings._replace(surface_temperature_K=wrong_K)


def charge(preset, since_s, drift_K_per_s=None, disturbance=DisturbanceKind.NONE):
    sensor = type(
        "Sensor", (FailingSurfaceSensor,), {"since_s": since_s, "drift_K_per_s": drift_K_per_s}
    )
    return run_both(Settings(preset, disturbance=disturbance), sensor_factory=sensor)


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
