"""The firmware charges the simulated cell over a bus and keeps every limit at every sub-step."""

import itertools

import pytest

from bms.errors import BusError, ModelMismatchError
from bms.firmware import Ecu
from bms.model.model_file import shipped_model_path
from bms.presets import load_preset
from hil_sim.bus.catalog import Mode
from hil_sim.logs.recorder import Recorder
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings
from tests.hil_sim.ecus import Contradicting, HotterThanAllowed, OftenDamaged, SilentAfter

SHORT_S = 20.0


@pytest.mark.parametrize(
    ("disturbance", "charger_delay_periods"),
    [
        (DisturbanceKind.NONE, 0),
        (DisturbanceKind.GAUSSIAN, 0),
        (DisturbanceKind.BANG_BANG, 1),
        (DisturbanceKind.UPWARD, 1),
    ],
)
def test_a_full_charge_keeps_every_limit(any_preset, disturbance, charger_delay_periods):
    settings = Settings(
        any_preset, disturbance=disturbance, charger_delay_periods=charger_delay_periods
    )
    summary = run_both(settings).summary
    assert summary.violations == ()
    assert summary.limits_kept
    assert summary.stop_reason == "complete"
    assert summary.final_soc == pytest.approx(any_preset.limits.completion_soc, abs=2e-3)
    assert summary.kan_max_abs_error_K <= summary.error_bound_K
    assert 0.0 < summary.first_derate_s < summary.charge_time_s


@pytest.mark.parametrize("disturbance", [DisturbanceKind.NONE, DisturbanceKind.BANG_BANG])
def test_a_model_that_remembers_keeps_every_limit_and_charges_faster(preset, disturbance):
    remembering = shipped_model_path(preset.name, lagged=True)
    static = run_both(Settings(preset, disturbance=disturbance)).summary
    lagged = run_both(Settings(preset, model=remembering, disturbance=disturbance)).summary
    assert lagged.violations == ()
    assert lagged.stop_reason == "complete"
    assert lagged.kan_max_abs_error_K <= lagged.error_bound_K < 0.5 * static.error_bound_K
    assert lagged.charge_time_s < static.charge_time_s


def test_limits_that_the_firmware_does_not_keep_are_seen(preset):
    result = run_both(
        Settings(preset, mode=Mode.FIXED, max_time_s=400.0),
        ecu_factory=lambda plant, database: HotterThanAllowed(preset, excess_K=5.0),
    )
    assert not result.summary.limits_kept
    assert not result.summary.passed
    assert "core temperature" in result.summary.violations[0]
    assert max(result.series.core_temperature_K) > preset.limits.max_core_temperature_K


def test_the_baseline_crosses_the_core_limit_as_in_the_paper(preset):
    summary = run_both(Settings(preset, controller=ControllerKind.S_CBF)).summary
    assert summary.max_core_temperature_K > preset.limits.max_core_temperature_K + 2.0
    assert not summary.passed
    assert summary.stop_reason == "complete"
    assert (summary.kan_rmse_K, summary.kan_max_abs_error_K, summary.model_hash) == (None,) * 3


def log_of(path, **changes):
    settings = Settings(
        load_preset("paper_calibrated"),
        max_time_s=SHORT_S,
        **{"disturbance": DisturbanceKind.BANG_BANG, **changes},
    )
    with Recorder(path) as recorder:
        run_both(settings, recorder)
    return path.read_bytes()


def test_the_seed_decides_every_byte_of_the_log(tmp_path):
    first = log_of(tmp_path / "1.log", seed=7)
    assert log_of(tmp_path / "2.log", seed=7) == first
    assert log_of(tmp_path / "3.log", seed=8) != first


def test_the_name_of_the_bus_changes_nothing(tmp_path):
    assert log_of(tmp_path / "1.log") == log_of(tmp_path / "2.log", bus="virtual:other")


def test_sensor_noise_is_the_same_with_and_without_disturbance(tmp_path):
    """Seeds are split, so that runs which differ in one thing can be compared."""
    calm, stormy = (
        log_of(tmp_path / f"{kind.value}.log", disturbance=kind).splitlines()[:40]
        for kind in (DisturbanceKind.NONE, DisturbanceKind.UPWARD)
    )
    assert calm == stormy


def test_the_charger_stops_when_the_ecu_falls_silent(preset):
    steps = 50
    result = run_both(
        Settings(preset, answer_timeout_s=0.005),
        ecu_factory=lambda plant, database: SilentAfter(preset, steps),
    )
    current_A = result.series.current_A
    assert result.summary.stop_reason == "ecu-silent"
    assert not result.summary.passed
    assert result.series.command_A[steps:] == [None] * (len(current_A) - steps)
    assert current_A[steps - 1] == current_A[steps] < 0.0
    assert set(current_A[steps + 1 :]) == {0.0}


def test_the_charger_stops_when_commands_come_often_damaged(preset):
    """Each period brings an intact one too; after three bad periods the message is not valid."""
    steps = 50
    result = run_both(
        Settings(preset), ecu_factory=lambda plant, database: OftenDamaged(preset, steps)
    )
    series = result.series
    assert result.summary.stop_reason == "fault"
    assert None not in series.command_A
    assert series.current_A[: steps + 2] == [
        command_A or 0.0 for command_A in series.usable_command_A[: steps + 2]
    ]
    assert set(series.usable_command_A[steps + 2 :]) == {None}
    assert series.current_A[steps + 2] == series.current_A[steps + 1] < 0.0
    assert set(series.current_A[steps + 3 :]) == {0.0}


def test_one_identity_of_somebody_else_does_not_end_the_run(preset):
    """The message is not protected, so that any 8 bytes under its identifier are one."""
    result = run_both(
        Settings(preset, max_time_s=SHORT_S),
        ecu_factory=lambda plant, database: Contradicting(preset, times=1),
    )
    assert result.summary.stop_reason == "time-limit"
    assert preset.hash.startswith(result.summary.preset_hash)
    assert (
        result.summary.model_hash == run_both(Settings(preset, max_time_s=1.0)).summary.model_hash
    )


def test_an_ecu_that_says_twice_that_it_is_another_one_ends_the_run(preset):
    with pytest.raises(ModelMismatchError, match="the ECU runs a preset with hash"):
        run_both(
            Settings(preset, max_time_s=SHORT_S),
            ecu_factory=lambda plant, database: Contradicting(preset, times=2),
        )


def test_an_ecu_that_says_twice_that_its_frames_are_of_another_version_ends_the_run(preset):
    with pytest.raises(BusError, match=r"version 253 of the CAN database.*; flash it anew"):
        run_both(
            Settings(preset, max_time_s=SHORT_S),
            ecu_factory=lambda plant, database: Contradicting(
                preset, times=2, is_of_this_version=False
            ),
        )


def test_without_any_ecu_there_is_no_run(preset):
    with pytest.raises(BusError, match="no ECU answers"):
        run_both(
            Settings(preset, answer_timeout_s=0.001),
            ecu_factory=lambda plant, database: SilentAfter(preset, 0),
        )


def test_an_ecu_with_another_preset_is_refused(preset):
    with pytest.raises(ModelMismatchError, match="preset"):
        run_both(
            Settings(preset, max_time_s=SHORT_S),
            ecu_factory=lambda plant, database: Ecu(preset="lin2014"),
        )


def test_a_time_limit_ends_the_run_and_counts_from_the_start_of_the_charge(preset):
    summary = run_both(Settings(preset, max_time_s=2.0)).summary
    assert summary.stop_reason == "time-limit"
    assert summary.charge_time_s is None
    assert summary.passed
    assert summary.steps == 5 + round(2.0 / preset.timing.sampling_period_s)


def test_series_agree_with_the_summary(preset):
    result = run_both(Settings(preset, mode=Mode.FIXED, max_time_s=250.0))
    summary, series = result.summary, result.series
    assert len(series.time_s) == summary.steps
    assert series.time_s[5] == 0.0
    assert series.current_A[:5] == [0.0] * 5
    assert series.state[:5] == ["init"] * 2 + ["standby"] * 3
    derated_at = series.time_s.index(summary.first_derate_s)
    assert set(series.state[5:derated_at]) == {"charging"}
    assert series.state[derated_at] == "derated"
    falling = [b > a for a, b in itertools.pairwise(series.command_A[5:derated_at])]
    assert not any(falling)
    assert series.command_A[derated_at] > preset.limits.reference_current_A
    errors = [
        abs(estimate - truth)
        for estimate, truth in itertools.islice(
            zip(series.estimated_core_temperature_K, series.core_temperature_K), 5, None
        )
    ]
    assert summary.kan_max_abs_error_K == max(errors)
    assert summary.kan_rmse_K == pytest.approx((sum(e * e for e in errors) / len(errors)) ** 0.5)
