"""Cells of 0.5 to 300 A h and three chemistries, from a preset's file to a full cell."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bms.bus_signals import RANGES
from bms.calibration.plausibility import plausibility_fields
from bms.cell import OpenCircuitVoltage
from bms.errors import InputError
from bms.identification.preset_toml import preset_toml
from bms.image import calibration_part
from bms.presets import load_preset
from bms.presets.authoring.complaints import complaints
from hil_sim.fault_matrix.runner import MatrixSettings, play
from hil_sim.run.session import run_sil
from hil_sim.run.settings import Settings
from tests.bms.cell_sizes import SHEETS, size_preset
from tests.bms.plausible_presets import model_for
from tests.hil_sim.test_faults_matrix import named

FAULTS = (
    "current sensor biased a little: offset 0.5",
    "voltage sensor biased: offset 0.5",
    "report of the cooling power biased: offset 0.2",
)


def settings_of(preset):
    """A family relies on its observer alone, so that any network will do."""
    return preset, model_for(preset, shipped="a123_26650_10C")


@pytest.mark.parametrize("name", SHEETS)
def test_a_cell_of_any_size_is_charged_full_within_its_limits(name, tmp_path):
    """From its file, which nothing is to be said about, as calibration, over the bus."""
    path = tmp_path / "cell.toml"
    path.write_text(preset_toml(size_preset(name)), encoding="utf-8")
    assert complaints(path) == []
    preset, model = settings_of(load_preset(path))
    assert calibration_part(preset, model)

    nearly = replace(preset.initial, soc=preset.limits.completion_soc - 0.03)
    summary = run_sil(Settings(preset, model=model, initial=nearly, max_time_s=2400.0)).summary

    assert (summary.stop_reason, summary.failures) == ("complete", [])
    assert summary.final_soc >= preset.limits.completion_soc - 0.005


@pytest.mark.parametrize("name", ["lto_18650_0.5Ah", "lfp_prismatic_280Ah"])
@pytest.mark.parametrize("row", FAULTS)
def test_faults_follow_the_smallest_and_a_large_cell(name, row):
    verdict = play(MatrixSettings(*settings_of(size_preset(name))), named(row))
    assert (verdict.failures, verdict.does_not_apply) == ((), None)


@pytest.mark.parametrize("name", SHEETS)
def test_what_is_believed_of_a_reading_has_room_around_the_cell_and_on_the_bus(name):
    preset = size_preset(name)
    block, limits = plausibility_fields(preset), preset.limits
    step_A = limits.current_growth_A_per_s * preset.timing.sampling_period_s
    assert step_A < block["current_deviation_A"] < -limits.reference_current_A
    assert block["voltage_V"]["low"] < preset.cell.ocv.voltage_V[0]
    assert limits.max_voltage_V < block["voltage_V"]["high"] < RANGES.voltage_V[1]
    low_W, high_W = preset.operating_box.cooling_power_W
    assert block["cooling_power_W"]["low"] < low_W
    assert high_W < block["cooling_power_W"]["high"] < RANGES.cooling_power_W[1]


RAMP = OpenCircuitVoltage((0.0, 1.0), (3.0, 3.6))


@pytest.mark.parametrize(
    ("key", "edit"),
    [
        ("cell.capacity_Ah", {"cell": {"capacity_Ah": 301.0}}),
        ("cell.ocv.soc", {"cell": {"ocv": OpenCircuitVoltage(
            tuple(i / 64 for i in range(65)), tuple(float(RAMP(i / 64)) for i in range(65))
        )}}),
        ("limits.max_voltage_V", {"limits": {"max_voltage_V": 4.51}}),
        ("limits.max_core_temperature_K", {"limits": {"max_core_temperature_K": 354.0}}),
        ("operating_box.cooling_power_W", {"operating_box": {"cooling_power_W": (-1.0, 44.0)}}),
        ("current_map.soc", {"current_map": {
            "soc": tuple(i / 8 for i in range(9)), "largest_A": ((140.0,) * 9,) * 3
        }}),
    ],
)  # fmt: skip
def test_what_the_firmware_would_not_take_is_told_before_anything_is_trained(key, edit, tmp_path):
    """And the firmware's own calibration does refuse it."""
    preset = size_preset("lfp_prismatic_280Ah")
    (table, values), *_ = edit.items()
    edited = replace(preset, **{table: replace(getattr(preset, table), **values)})
    path = tmp_path / "cell.toml"
    path.write_text(preset_toml(edited), encoding="utf-8")
    assert [one.key for one in complaints(path)] == [key]
    with pytest.raises(InputError):
        calibration_part(*settings_of(edited))


def test_a_ramp_that_would_hide_a_quarter_of_the_current_is_refused():
    """The charger is a step behind, so the deviation that is permitted grows with the ramp."""
    preset = load_preset("paper_calibrated")
    most_A_per_s = 23.0 / 8.0 / preset.timing.sampling_period_s
    taken, refused = (
        replace(preset, limits=replace(preset.limits, current_growth_A_per_s=one_A_per_s))
        for one_A_per_s in (most_A_per_s, 1.001 * most_A_per_s)
    )
    assert plausibility_fields(taken)["current_deviation_A"] == pytest.approx(23.0 / 4.0)
    with pytest.raises(InputError, match=r"limits.current_growth_A_per_s: .*at most 28.75"):
        plausibility_fields(refused)
