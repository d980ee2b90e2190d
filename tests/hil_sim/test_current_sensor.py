"""A current sensor off by less than the monitor sees neither overfills nor overheats the cell."""

from __future__ import annotations

import pytest

from hil_sim.faults import parse_fault
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings


@pytest.mark.parametrize("offset_A", [-0.5, 0.3, 0.5])
def test_a_small_bias_over_a_whole_charge_crosses_no_limit(any_preset, offset_A):
    fault = {"kind": "sensor-biased", "sensor": "current_A", "offset": offset_A, "from_s": 0.0}
    summary = run_both(Settings(any_preset, faults=(parse_fault(fault, "test"),))).summary
    assert summary.violations == ()
    assert summary.stop_reason == "complete"
    assert summary.max_soc <= any_preset.limits.completion_soc + 0.001


def test_a_sensor_that_reads_too_little_does_not_end_the_charge_late(any_preset):
    fault = {"kind": "sensor-biased", "sensor": "current_A", "offset": 0.5, "from_s": 0.0}
    biased = run_both(Settings(any_preset, faults=(parse_fault(fault, "test"),))).summary
    healthy = run_both(Settings(any_preset)).summary
    assert biased.charge_time_s == pytest.approx(healthy.charge_time_s, abs=1.0)
