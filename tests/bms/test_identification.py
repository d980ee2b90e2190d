"""Cell parameters from measured temperatures: recovery of known cells, and honesty about limits."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from bms.cell import CellState, integrate_step
from bms.data.measurements import COLUMNS, Measurements, read_measurements
from bms.errors import InputError
from bms.identification import NotIdentifiedError, identify
from bms.identification.identify import CORRECTIONS, FITTED
from bms.identification.preset_toml import preset_toml
from bms.identification.trajectory import thermal_trajectory
from bms.presets import load_preset, preset_names
from bms.validation import parse, read_toml
from tests.bms.kan_samples import write_recording

MEASURED = Path(__file__).parents[3] / "shared" / "data" / "a123_26650_hev_cycle_1.csv"
START = load_preset("lin2014")
TRUTH = dataclasses.replace(
    START.cell,
    core_resistance_K_per_W=2.6,
    surface_resistance_K_per_W=4.1,
    surface_heat_capacity_J_per_K=7.0,
    ohmic_resistance_ohm=0.017,
    entropic_coefficient_V_per_K=1.5e-4,
)
SUBSTEPS = 4


def recorded(cell, rows=1200, noise_K=0.0, current_A=None, period_s=1.1):
    """Recording of a drive cycle, simulated by Runge-Kutta steps of the cell model."""
    rng = np.random.default_rng(5)
    if current_A is None:
        current_A = np.repeat(rng.uniform(-30.0, 25.0, rows // 15 + 1), 15)[:rows]
        current_A[rows // 2 : rows // 2 + 150] = 0.0
    rows = len(current_A)
    state, states = CellState(0.5, 285.0, 284.0, 283.0), []
    for current in current_A:
        states.append(state)
        for _ in range(SUBSTEPS):
            state = integrate_step(cell, state, current, 0.05, period_s / SUBSTEPS)
    _, core_K, surface_K, coolant_K = np.array(states).T
    return Measurements(
        time_s=period_s * np.arange(rows),
        current_A=np.asarray(current_A),
        cooling_power_W=np.full(rows, 0.05),
        surface_temperature_K=surface_K + noise_K * rng.standard_normal(rows),
        coolant_temperature_K=coolant_K,
        core_temperature_K=core_K + noise_K * rng.standard_normal(rows),
    )


def estimates(result):
    return {parameter.name: parameter for parameter in result.parameters}


def test_trajectory_is_that_of_the_cell_model_at_the_recordings_own_times():
    recording = recorded(TRUTH)

    core_K, surface_K = thermal_trajectory(TRUTH, recording)

    np.testing.assert_allclose(core_K, recording.core_temperature_K, atol=1e-4)
    np.testing.assert_allclose(surface_K, recording.surface_temperature_K, atol=1e-4)


def test_trajectory_stays_finite_over_gaps_of_hours():
    recording = recorded(TRUTH, rows=150)
    gap = dataclasses.replace(recording, time_s=recording.time_s * 1e4)

    assert np.all(np.isfinite(thermal_trajectory(TRUTH, gap)))


def test_known_cell_is_recovered_from_noise_free_temperatures():
    result = identify(recorded(TRUTH), START)

    assert result.starts_at_minimum == result.starts
    for parameter in estimates(result).values():
        expected = getattr(TRUTH, parameter.name)
        assert parameter.value == pytest.approx(expected, rel=1e-3)
        assert getattr(result.cell, parameter.name) == parameter.value
    assert result.fitted.core_rmse_K < 1e-4
    assert result.held_out is None


def test_noisy_temperatures_give_the_cell_within_the_standard_errors():
    recording = recorded(TRUTH, noise_K=0.05)
    rows = slice(0, 1000)

    result = identify(recording, START, rows)

    fitted = [e for e in result.parameters if e.standard_error is not None]
    assert len(fitted) == 5
    for parameter in fitted:
        error = abs(parameter.value - getattr(TRUTH, parameter.name))
        assert error <= 4.0 * parameter.standard_error
        assert parameter.standard_error < 0.1 * abs(parameter.value)
    assert (result.fitted.rows, result.held_out.rows) == (1000, 200)
    assert result.held_out.core_rmse_K == pytest.approx(0.05, rel=0.15)
    assert result.held_out.surface_rmse_K == pytest.approx(0.05, rel=0.15)


def test_standard_errors_never_claim_more_than_the_sensors_can_tell():
    """Noise-free data: the errors are those of the preset's sensors, and scale with them."""
    recording = recorded(TRUTH)
    channel = dataclasses.replace(START.sensors.surface_temperature_K, resolution=1.0)
    coarse = dataclasses.replace(
        START, sensors=dataclasses.replace(START.sensors, surface_temperature_K=channel)
    )

    fine, rough = (estimates(identify(recording, start)) for start in (START, coarse))

    ratio = channel.error_bound / START.sensors.surface_temperature_K.error_bound
    name = "core_resistance_K_per_W"
    assert fine[name].standard_error > 0.0
    assert rough[name].standard_error == pytest.approx(ratio * fine[name].standard_error, rel=0.01)


def test_noise_beyond_the_fitted_rows_does_not_change_the_cell():
    recording = recorded(TRUTH)
    spoilt = dataclasses.replace(
        recording, core_temperature_K=recording.core_temperature_K + (np.arange(1200) >= 1000)
    )

    assert identify(spoilt, START, slice(1000)).cell == identify(recording, START, slice(1000)).cell
    assert identify(spoilt, START, slice(1000)).held_out.core_rmse_K == pytest.approx(1.0, abs=1e-3)


def test_temperatures_alone_do_not_fix_the_scale():
    """With the heat capacity halved, resistances double and heats halve: the same temperatures."""
    halved = dataclasses.replace(
        START,
        cell=dataclasses.replace(
            START.cell,
            core_heat_capacity_J_per_K=0.5 * START.cell.core_heat_capacity_J_per_K,
        ),
    )

    result = identify(recorded(TRUTH), halved).cell

    assert result.core_heat_capacity_J_per_K == halved.cell.core_heat_capacity_J_per_K
    assert result.core_resistance_K_per_W == pytest.approx(
        2.0 * TRUTH.core_resistance_K_per_W, rel=1e-3
    )
    assert result.ohmic_resistance_ohm == pytest.approx(0.5 * TRUTH.ohmic_resistance_ohm, rel=1e-3)


def test_without_current_the_heat_sources_keep_the_presets_values_and_it_is_said():
    cooling_down = recorded(TRUTH, current_A=np.zeros(600))

    result = identify(cooling_down, START)

    for name in ("ohmic_resistance_ohm", "entropic_coefficient_V_per_K"):
        estimate = estimates(result)[name]
        assert estimate.standard_error is None
        assert "not identifiable" in estimate.remark
        assert getattr(result.cell, name) == getattr(START.cell, name)
        assert name not in result.correlated


def test_kept_correction_without_a_say_leaves_the_cell_usable():
    """Noise of 2 K hides the reversible heat, which then moves the temperatures by less."""
    slow = recorded(TRUTH, rows=600, noise_K=2.0, current_A=np.repeat([-9.0, 0.0, -15.0], 200))

    result = identify(slow, START)

    assert estimates(result)["entropic_coefficient_V_per_K"].standard_error is None
    assert result.not_identified == {}


def test_everything_identified_leaves_no_reason():
    assert identify(recorded(TRUTH, rows=400), START).not_identified == {}


def test_heat_without_current_is_not_identified():
    result = identify(recorded(TRUTH, current_A=np.zeros(600)), START)

    assert "ohmic_resistance_ohm" in result.not_identified
    assert "pulses of current" in result.not_identified["ohmic_resistance_ohm"]


@pytest.mark.parametrize(("factor", "is_identified"), [(95.0, True), (105.0, False)])
def test_parameter_at_the_bound_of_the_search_is_not_identified(factor, is_identified):
    """The search goes to 100 times the start on either side."""
    name = "surface_resistance_K_per_W"
    cell = dataclasses.replace(TRUTH, **{name: factor * getattr(START.cell, name)})

    result = identify(recorded(cell), START)

    assert (name not in result.not_identified) == is_identified
    if is_identified:
        assert getattr(result.cell, name) == pytest.approx(getattr(cell, name), rel=0.01)
    else:
        assert "at the bound of the search" in result.not_identified[name]
        assert getattr(result.cell, name) == getattr(START.cell, name)


def test_surface_in_the_place_of_the_core_tells_nothing_of_the_resistance_between_them():
    recording = recorded(TRUTH)
    copied = dataclasses.replace(recording, core_temperature_K=recording.surface_temperature_K)

    result = identify(copied, START)

    assert "equals surface_temperature_K" in result.not_identified["core_resistance_K_per_W"]


def test_cell_at_rest_identifies_nothing():
    at_rest = dataclasses.replace(
        recorded(TRUTH, current_A=np.zeros(200)),
        **{f"{part}_temperature_K": np.full(200, 290.0) for part in ("core", "surface", "coolant")},
    )

    with pytest.raises(NotIdentifiedError, match="no parameter can be identified") as refused:
        identify(at_rest, START)
    assert set(FITTED) - set(refused.value.reasons) <= set(CORRECTIONS)


@pytest.mark.parametrize(("rows", "enough"), [(slice(99), False), (slice(100), True)])
def test_a_hundred_rows_are_needed(rows, enough):
    recording = recorded(TRUTH, rows=200)
    if enough:
        assert identify(recording, START, rows).fitted.rows == 100
    else:
        with pytest.raises(InputError, match="at least 100"):
            identify(recording, START, rows)


@pytest.mark.parametrize("name", preset_names())
def test_preset_written_as_toml_reads_the_same(name, tmp_path):
    preset = dataclasses.replace(load_preset(name), description='quoted "text" \\ °C')
    (tmp_path / "p.toml").write_text(preset_toml(preset), encoding="utf-8")

    assert load_preset(tmp_path / "p.toml") == preset
    with_gain = dataclasses.replace(
        preset, gains=dataclasses.replace(preset.gains, alpha2_per_s=1e-17)
    )
    (tmp_path / "p.toml").write_text(preset_toml(with_gain), encoding="utf-8")
    assert parse(type(preset), read_toml(tmp_path / "p.toml"), "p.toml") == with_gain


@pytest.mark.skipif(not MEASURED.is_file(), reason="not run: no measured data in ../shared/data")
def test_measured_drive_cycle():
    recording = read_measurements(MEASURED)

    result = identify(recording, START, slice(round(2 / 3 * len(recording.time_s))))

    assert result.held_out is not None
    assert result.fitted.core_rmse_K < 0.95
    assert result.held_out.core_rmse_K < 0.92
    assert result.held_out.surface_rmse_K < 0.57
    assert 0.008 < result.cell.ohmic_resistance_ohm < 0.0241


@pytest.fixture(scope="module")
def csv(tmp_path_factory):
    """A recording of the known cell as CSV."""
    recording = recorded(TRUTH, rows=450, noise_K=0.01)
    columns = {name: getattr(recording, name) for name in COLUMNS}
    path = tmp_path_factory.mktemp("recording") / "run.csv"
    return write_recording(path, rows=450, **columns)


def test_command_writes_a_preset_with_the_cell_that_it_prints(bms, csv, tmp_path):
    code, out, _ = bms("identify", "--data", csv, "--out", tmp_path / "mine.toml", "--json")

    result, preset = json.loads(out), load_preset(tmp_path / "mine.toml")
    assert code == 0
    assert preset.name == "mine"
    assert "run.csv" in preset.description
    for name, parameter in result["parameters"].items():
        assert getattr(preset.cell, name) == pytest.approx(parameter["value"], rel=1e-5)
        assert parameter["start"] == getattr(START.cell, name)
    assert preset.cell.core_resistance_K_per_W == pytest.approx(2.6, rel=0.05)
    assert (result["fitted"]["rows"], result["held_out"]["rows"]) == (300, 150)
    assert result["held_out"]["core_rmse_K"] < 0.05
    as_before = dataclasses.replace(preset, cell=START.cell, uncertainty=START.uncertainty)
    assert dataclasses.replace(as_before, name="", description="", sources=()) == (
        dataclasses.replace(START, name="", description="", sources=())
    )


def test_command_prints_what_was_not_identified(bms, csv):
    code, out, _ = bms("identify", "--data", csv)

    text = " ".join(out.replace("│", " ").split())
    assert code == 0
    assert "core_heat_capacity_J_per_K" in text
    assert "kept" in text
    assert "strongest correlation" in text


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (
            lambda columns: {"core_temperature_K": columns["surface_temperature_K"]},
            "core_resistance_K_per_W",
        ),
        (lambda columns: {"current_A": columns["current_A"] / 1e3}, "ohmic_resistance_ohm"),
        (
            lambda columns: {"core_temperature_K": columns["core_temperature_K"] + 80.0},
            "surface_resistance_K_per_W",
        ),
        (
            lambda columns: {
                "current_A": np.zeros(450),
                "surface_temperature_K": np.full(450, 290.0),
                "coolant_temperature_K": np.full(450, 290.0),
                "core_temperature_K": np.full(450, 290.0),
            },
            "ohmic_resistance_ohm",
        ),
    ],
    ids=["core is surface", "current in kA", "core in another scale", "at rest"],
)
def test_what_is_not_identified_is_told_by_name_and_no_preset_is_written(
    bms, tmp_path, spoil, named
):
    recording = recorded(TRUTH, rows=450, noise_K=0.01)
    columns = {name: getattr(recording, name) for name in COLUMNS}
    columns |= spoil(columns)
    path = write_recording(tmp_path / "run.csv", rows=450, **columns)

    code, _, err = bms("identify", "--data", path, "--out", tmp_path / "mine.toml")

    lines = err.splitlines()
    assert code == 1
    assert any(line.startswith(f"bms: {named}: not identified: ") for line in lines)
    assert all(": not identified: " in line for line in lines)
    assert len(lines) == len({line.split(":")[1] for line in lines})
    assert [item.name for item in tmp_path.iterdir()] == ["run.csv"]


def test_json_holds_what_was_not_identified(bms, tmp_path):
    recording = recorded(TRUTH, rows=450)
    columns = {name: getattr(recording, name) for name in COLUMNS}
    columns["core_temperature_K"] = columns["surface_temperature_K"]
    path = write_recording(tmp_path / "run.csv", rows=450, **columns)

    code, out, _ = bms("identify", "--data", path, "--json")

    assert code == 1
    assert "core_resistance_K_per_W" in json.loads(out)["not_identified"]


@pytest.mark.skipif(not MEASURED.is_file(), reason="not run: no measured data in ../shared/data")
def test_measured_drive_cycle_gives_a_preset(bms, tmp_path):
    code, _, err = bms("identify", "--data", MEASURED, "--out", tmp_path / "mine.toml")

    # On a busy machine it takes long enough to say how far it is.
    told = [line for line in err.splitlines() if not line.startswith("bms: fitting from several")]
    assert (code, told) == (0, [])
    assert load_preset(tmp_path / "mine.toml").cell.ohmic_resistance_ohm > 0.008


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "--data"),
        (["--data", "{tmp}/absent.csv"], "absent.csv"),
        (["--data", "{csv}", "--preset", "nobody"], "nobody"),
        (["--data", "{csv}", "--out", "{tmp}/mine.json"], ".toml"),
        (["--data", "{csv}", "--out", "{tmp}/absent/mine.toml"], "cannot be written"),
        (["--data", "{short}"], "at least 100"),
    ],
)
def test_wrong_use_is_one_line_on_stderr_and_exit_2(bms, csv, tmp_path, arguments, told):
    short = write_recording(tmp_path / "short.csv", rows=120)
    places = {"tmp": tmp_path, "csv": csv, "short": short}

    code, out, err = bms("identify", *(argument.format(**places) for argument in arguments))

    assert code == 2
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["short.csv"]
