"""What faults of sensors, charger, pump, ECU and clock do, seen in a charge or by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bms.cell import CellState
from bms.errors import InputError
from hil_sim.bus.buses import Frame
from hil_sim.bus.database import load_codecs
from hil_sim.faults import Injection, parse_fault
from hil_sim.plant.sensors import Readings
from hil_sim.run.session import run_both, run_plant
from hil_sim.run.settings import Settings

HEALTHY = Readings(-10.0, 3.3, 300.0, 299.0, 0.25)
TRUTH = CellState(0.5, 303.0, 300.0, 299.0)
FROM = 3


class StillPlant:
    cooling_power_W = 0.25


def injection(*faults, seed=0, clock=None):
    return Injection(
        [parse_fault(fault, "test") for fault in faults],
        0.1,
        np.random.SeedSequence(seed),
        load_codecs(),
        clock,
    )


def readings(sensor, periods=8, seed=0, **fault):
    """Readings of a sensor that rises by 1 in every period, with the fault from FROM on."""
    faults = injection({"sensor": sensor, "from_period": FROM, **fault}, seed=seed)
    seen = []
    for period in range(periods):
        faults.begin(period, StillPlant())
        healthy = HEALTHY._replace(**{sensor: getattr(HEALTHY, sensor) + period})
        faulty = faults.readings(healthy, TRUTH)
        others = set(Readings._fields) - {sensor}
        assert all(getattr(faulty, name) == getattr(healthy, name) for name in others)
        seen.append(getattr(faulty, sensor))
    return seen


@pytest.mark.parametrize(
    ("sensor", "fault", "expected"),
    [
        ("voltage_V", {"kind": "sensor-stuck"}, [3.3, 4.3, 5.3, 5.3, 5.3, 5.3]),
        ("voltage_V", {"kind": "sensor-stuck", "for_s": 0.2}, [3.3, 4.3, 5.3, 5.3, 5.3, 8.3]),
        (
            "voltage_V",
            {"kind": "sensor-drifting", "rate_per_s": -10.0},
            [3.3, 4.3, 5.3, 6.3, 6.3, 6.3],
        ),
        ("current_A", {"kind": "sensor-biased", "offset": 2.0}, [-10, -9, -8, -5, -4, -3]),
        ("current_A", {"kind": "sensor-out-of-range", "value": 99.0}, [-10, -9, -8, 99, 99, 99]),
        (
            "coolant_temperature_K",
            {"kind": "sensor-unit-swapped"},
            [299, 300, 301, 28.85, 29.85, 30.85],
        ),
        (
            "cooling_power_W",
            {"kind": "sensor-unit-swapped"},
            [0.25, 1.25, 2.25, 3250, 4250, 5250],
        ),
        (
            "surface_temperature_K",
            {"kind": "surface-above-core", "excess_K": 2.0},
            [300, 301, 302, 305, 305, 305],
        ),
    ],
)
def test_a_sensor_reads_what_its_fault_says(sensor, fault, expected):
    assert readings(sensor, 6, **fault) == pytest.approx(expected)


def test_a_jumping_sensor_is_one_amplitude_off_either_way_and_follows_the_seed():
    healthy = [3.3 + period for period in range(40)]
    runs = [
        readings("voltage_V", 40, seed, kind="sensor-jumping", amplitude=0.5) for seed in (1, 1, 2)
    ]
    off = [round(seen - right, 6) for seen, right in zip(runs[0], healthy)]
    assert set(off[:FROM]) == {0.0}
    assert set(off[FROM:]) == {-0.5, 0.5}
    assert runs[0] == runs[1] != runs[2]


@pytest.mark.parametrize("name", ["Current", "Voltage", "SurfaceTemperature", "CoolingPower"])
def test_a_sensor_that_is_not_available_is_sent_as_all_ones(name):
    fields = {
        "Current": ("current_A", "CellElectrical"),
        "Voltage": ("voltage_V", "CellElectrical"),
        "SurfaceTemperature": ("surface_temperature_K", "CellThermal"),
        "CoolingPower": ("cooling_power_W", "Coolant"),
    }
    sensor, message = fields[name]
    value = readings(sensor, kind="sensor-not-available")[-1]
    assert math.isnan(value)
    codec = load_codecs()[message]
    assert codec.decode(codec.encode({name: value}))[name] is None
    bits = int.from_bytes(codec.encode({name: value}), "little")
    assert bin(bits >> 12).count("1") >= 16


def test_two_faults_of_one_sensor_add_up():
    bias = {"kind": "sensor-biased", "sensor": "voltage_V", "offset": 0.5, "from_period": 0}
    faults = injection(bias, bias)
    faults.begin(0, StillPlant())
    assert faults.readings(HEALTHY, TRUTH).voltage_V == pytest.approx(4.3)


def charge(preset, *faults, max_time_s=6.0, **settings):
    faults = tuple(parse_fault(fault, "test") for fault in faults)
    settings = {"ends_early": False, "answer_timeout_s": 0.0, **settings}
    return run_both(Settings(preset, max_time_s=max_time_s, faults=faults, **settings))


def at(result, time_s):
    """Index of the period that begins at a time."""
    return int(np.argmin(np.abs(np.array(result.series.time_s) - time_s)))


def test_a_charger_that_ignores_commands_keeps_its_current_and_then_obeys_again(preset):
    result = charge(preset, {"kind": "charger-stuck", "from_s": 3.0, "for_s": 2.0})
    series = result.series
    begin, end = at(result, 3.0), at(result, 5.0)
    assert set(series.current_A[begin:end]) == {series.current_A[begin - 1]}
    assert series.current_A[end] == series.command_A[end] == 0.0


def test_a_charger_with_a_gain_supplies_a_multiple(preset):
    result = charge(preset, {"kind": "charger-gain", "from_s": 3.0, "factor": 1.1})
    series = result.series
    begin = at(result, 3.0)
    assert series.current_A[begin - 1] == series.command_A[begin - 1]
    assert series.current_A[begin] == pytest.approx(1.1 * series.command_A[begin])


@pytest.mark.parametrize("reported", ["healthy", "failed"])
def test_a_failed_pump_draws_no_heat_whatever_it_reports(preset, reported):
    right = preset.initial.cooling_power_W
    faults = injection(
        {"kind": "pump-failed", "reported": reported, "from_period": 1, "for_periods": 2}
    )
    plant = StillPlant()
    plant.cooling_power_W = right
    powers, reports = [], []
    for period in range(5):
        faults.begin(period, plant)
        powers.append(plant.cooling_power_W)
        healthy = HEALTHY._replace(cooling_power_W=plant.cooling_power_W)
        reports.append(faults.readings(healthy, TRUTH).cooling_power_W)
    assert powers == [right, 0.0, 0.0, right, right]
    assert reports == ([right] * 5 if reported == "healthy" else powers)


def test_a_failed_pump_warms_the_coolant(preset):
    fault = {"kind": "pump-failed", "reported": "healthy", "from_s": 1.0}
    warm, cool = charge(preset, fault, max_time_s=30.0), charge(preset, max_time_s=30.0)
    warmer_K = warm.series.coolant_temperature_K[-1] - cool.series.coolant_temperature_K[-1]
    ideal_K = 29.0 * preset.initial.cooling_power_W / preset.cell.coolant_heat_capacity_J_per_K
    assert 0.5 * ideal_K < warmer_K < 1.05 * ideal_K


def test_an_ecu_that_restarts_is_silent_and_then_knows_nothing_any_more(preset):
    result = charge(preset, {"kind": "ecu-restarted", "from_s": 3.0, "for_periods": 2})
    series, begin = result.series, at(result, 3.0)
    assert series.state[begin - 1] == "charging"
    assert series.state[begin : begin + 2] == [None, None]
    # It counts its frames from 0 again: the first is out of sequence.
    assert series.state[begin + 2] is None
    assert set(series.state[begin + 3 :]) <= {"init", "standby"}
    assert series.estimated_soc[begin - 1] is not None
    assert set(series.estimated_soc[begin:]) == {None}
    assert set(series.current_A[begin + 1 :]) == {0.0}


def test_a_dead_ecu_ends_the_run(preset):
    fault = {"kind": "ecu-restarted", "from_s": 3.0}
    summary = charge(preset, fault, ends_early=True).summary
    assert summary.stop_reason == "ecu-silent"


class StoppedClock:
    """A clock on which time passes by sleeping only."""

    def __init__(self):
        self.time_s = 100.0
        self.slept_s = []

    def now_s(self):
        return self.time_s

    def sleep_until_s(self, time_s):
        self.slept_s.append(time_s - self.time_s)
        self.time_s = time_s


def test_jitter_delays_the_periods_of_its_window_by_up_to_its_bound():
    clock = StoppedClock()
    fault = {"kind": "clock-jitter", "late_ms": 40.0, "from_period": 2, "for_periods": 300}
    faults = injection(fault, clock=clock)
    for period in range(400):
        faults.begin(period, StillPlant())
    assert len(clock.slept_s) == 300
    assert 0.0 <= min(clock.slept_s) < 0.002
    assert 0.038 < max(clock.slept_s) <= 0.04


def test_before_the_charge_no_fault_acts():
    faults = injection({"kind": "bus-off", "from_period": 0})
    faults.begin(None, StillPlant())
    frames = [Frame(0x100, b"")]
    assert faults.injected == ()
    assert faults.sent(frames) == frames
    faults.begin(0, StillPlant())
    assert faults.sent(frames) == []
    assert len(faults.injected) == 1


def test_jitter_needs_real_time_and_a_restart_an_ecu_of_ones_own(preset):
    jitter = (parse_fault({"kind": "clock-jitter", "late_ms": 1.0, "from_s": 0.0}, "test"),)
    with pytest.raises(InputError, match="--realtime"):
        run_both(Settings(preset, faults=jitter))
    restart = (parse_fault({"kind": "ecu-restarted", "from_s": 0.0}, "test"),)
    with pytest.raises(InputError, match="bms sil"):
        run_plant(Settings(preset, bus="udp_multicast:239.1.1.1", faults=restart))


def test_without_faults_a_run_is_the_one_it_was_and_with_them_sensors_keep_their_noise(preset):
    plain = charge(preset)
    late = charge(preset, {"kind": "bus-off", "from_s": 5.9})
    assert plain.summary.faults == ()
    until = at(plain, 5.8)
    assert plain.series.command_A[:until] == late.series.command_A[:until]
