"""Recordings in another unit, or with the current turned, are refused with column and cause."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from bms.data.measurements import COLUMNS, read_measurements
from bms.errors import InputError
from bms.model.model_file import shipped_model_path
from tests.bms.kan_samples import write_recording

SHARED = Path(__file__).parents[3] / "shared"
DRIVE_CYCLE = SHARED / "data" / "a123_26650_hev_cycle_1.csv"
needs_cases = pytest.mark.skipif(
    not (SHARED / "cases").is_dir(), reason="not run: no failing inputs in ../shared/cases"
)
needs_data = pytest.mark.skipif(
    not DRIVE_CYCLE.is_file(), reason="not run: no measured data in ../shared/data"
)
ROWS = 300
COMMANDS = {
    "identify": ["identify", "--data", "{data}", "--out", "{tmp}/out.toml"],
    "train": ["train", "--data", "{data}", "--out", "{tmp}/out.json"],
    "evaluate": ["evaluate", "--model", "{model}", "--data", "{data}"],
    "bound": ["bound", "--model", "{model}", "--data", "{data}"],
}


def pulses(current_A=None):
    """A charge in pulses at 1 s: columns by name, with the voltage of a 10 mohm cell."""
    time_s = np.arange(float(ROWS))
    if current_A is None:
        current_A = np.where(time_s % 40 < 20, -12.0, -2.0)
    surface_K = 296.0 + 0.01 * time_s
    charge_Ah = -np.cumsum(current_A) / 3600.0
    return {
        "time_s": time_s,
        "current_A": current_A,
        "cooling_power_W": np.full(ROWS, 0.5),
        "surface_temperature_K": surface_K,
        "coolant_temperature_K": np.full(ROWS, 295.0),
        "core_temperature_K": surface_K + 1.0,
        "voltage_V": 3.3 - 0.01 * current_A + 0.2 * charge_Ah,
    }


def written(folder, columns):
    return write_recording(folder / "run.csv", rows=ROWS, **columns)


def refusal(folder, columns):
    with pytest.raises(InputError) as refused:
        read_measurements(written(folder, columns))
    (line,) = str(refused.value).splitlines()
    assert line.startswith(str(folder / "run.csv"))
    return line.removeprefix(str(folder / "run.csv: "))


def changed(name, change):
    columns = pulses()
    return {**columns, name: change(columns[name])}


def test_recording_in_the_units_of_its_columns_is_read(tmp_path):
    recording = read_measurements(written(tmp_path, pulses()))

    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(recording, name), pulses()[name])


@pytest.mark.parametrize(
    ("name", "change", "value", "cause"),
    [
        ("surface_temperature_K", lambda v: v - 273.15, "24.345", "degrees Celsius"),
        ("coolant_temperature_K", lambda v: v - 273.15, "21.85", "degrees Celsius"),
        ("core_temperature_K", lambda v: v - 273.15, "25.345", "degrees Celsius"),
        ("core_temperature_K", lambda v: v - 343.15, "-44.655", "degrees Celsius"),
        ("core_temperature_K", lambda v: 10 * v, "2970", "another unit than kelvin"),
        ("core_temperature_K", lambda v: np.where(v > 299.9, 0.0, v), "0 K", "sensor"),
        ("current_A", lambda v: 1e3 * v, "-12000", "milliampere"),
        ("current_A", lambda v: -1e3 * v, "12000", "milliampere"),
        ("time_s", lambda v: 1e3 * v, "1000", "milliseconds"),
        ("time_s", lambda v: v / 3600.0, "0.000278", "hours"),
        ("voltage_V", lambda v: 1e3 * v, "3428.67", "millivolt"),
        ("voltage_V", lambda v: -v, "-3.42867", "another column"),
        ("current_A", lambda v: -v, "+10 mV for each ampere", "positive while charging"),
        ("cooling_power_W", lambda v: np.full(ROWS, -2e4), "-20000", "milliwatt"),
    ],
)
def test_wrong_unit_or_sign_is_named_with_column_value_and_cause(
    tmp_path, name, change, value, cause
):
    told = refusal(tmp_path, changed(name, change))

    assert told.startswith(f"{name}: ")
    assert value in told
    assert "likely" in told
    assert cause in told


def test_every_column_in_celsius_is_named_in_the_one_line(tmp_path):
    columns = {
        name: values - 273.15 if name.endswith("_K") else values
        for name, values in pulses().items()
    }

    told = refusal(tmp_path, columns)

    for name in ("surface", "coolant", "core"):
        assert f"{name}_temperature_K" in told


@pytest.mark.parametrize(
    ("edge", "is_read"), [(200.1, True), (199.9, False), (499.9, True), (500.1, False)]
)
def test_limits_of_temperature_hold_from_both_sides(tmp_path, edge, is_read):
    columns = changed("core_temperature_K", lambda v: np.where(np.arange(ROWS) == 7, edge, v))
    if is_read:
        assert read_measurements(written(tmp_path, columns)).core_temperature_K[7] == edge
    else:
        assert f"{edge}" in refusal(tmp_path, columns)


@pytest.mark.parametrize(("step_s", "is_read"), [(59.0, True), (61.0, False)])
def test_limit_of_the_median_step_holds_from_both_sides(tmp_path, step_s, is_read):
    path = written(tmp_path, changed("time_s", lambda v: step_s * v))
    if is_read:
        assert read_measurements(path).time_s[1] == step_s
    else:
        with pytest.raises(InputError, match="median step 61 s"):
            read_measurements(path)


def test_milliseconds_of_a_fast_logger_show_in_the_duration(tmp_path):
    """10 ms a step are no impossible 10 s, but an hour becomes weeks."""
    rows = 121_000
    columns = {
        name: np.interp(np.linspace(0.0, ROWS - 1.0, rows), np.arange(ROWS), values)
        for name, values in pulses().items()
    }
    columns["time_s"] = 10.0 * np.arange(rows)

    with pytest.raises(InputError, match=r"time_s: 1\.20999e\+06 s, 14 days"):
        read_measurements(write_recording(tmp_path / "run.csv", rows=rows, **columns))


def test_small_current_in_milliampere_shows_in_the_charge(tmp_path):
    """300 A are a large cell's, but not for a night."""
    columns = pulses(current_A=np.full(ROWS, -300.0)) | {"time_s": 50.0 * np.arange(ROWS)}
    del columns["voltage_V"]

    assert "moves 1245.83 Ah" in refusal(tmp_path, columns)


def test_small_current_in_milliampere_shows_in_the_resistance(tmp_path):
    told = refusal(tmp_path, changed("current_A", lambda v: 50.0 * v) | {"voltage_V": (
        3.3 - 1e-5 * 50.0 * pulses()["current_A"]
    )})  # fmt: skip

    assert "current_A" in told
    assert "milliampere" in told


def test_turned_constant_current_shows_in_the_course_of_the_voltage(tmp_path):
    rising = pulses(current_A=np.full(ROWS, -9.0))

    assert read_measurements(written(tmp_path, rising)).current_A[0] == -9.0
    assert "goes from" in refusal(tmp_path, rising | {"current_A": -rising["current_A"]})


def test_charger_that_holds_the_voltage_is_no_turned_current(tmp_path):
    """In the last phase of a charge noise of voltage and current moves alike."""
    noise = np.random.default_rng(3).normal(0.0, 1.0, ROWS)
    current_A = -5.0 * np.exp(-np.arange(ROWS) / 60.0) + 0.02 * noise
    columns = pulses(current_A=current_A) | {"voltage_V": 3.6 + 0.004 * noise}

    assert read_measurements(written(tmp_path, columns)).current_A[0] == current_A[0]


def test_voltage_may_be_absent_or_full_of_holes(tmp_path):
    turned = changed("current_A", lambda v: -v)
    holes = np.where(np.arange(ROWS) % 3 == 0, turned["voltage_V"], np.nan)

    assert "ampere" in refusal(tmp_path, turned | {"voltage_V": holes})
    read_measurements(written(tmp_path, turned | {"voltage_V": [""] * ROWS}))
    del turned["voltage_V"]
    read_measurements(written(tmp_path, turned))


def test_core_that_is_the_surfaces_copy_teaches_nothing(tmp_path):
    columns = pulses()
    columns["core_temperature_K"] = columns["surface_temperature_K"]

    assert "core_temperature_K: 296 K and so on, equal to surface" in refusal(tmp_path, columns)
    columns["core_temperature_K"] = columns["surface_temperature_K"] + (np.arange(ROWS) == 9)
    read_measurements(written(tmp_path, columns))


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_reads_recordings_refuses_them(bms, tmp_path, command):
    data = written(tmp_path, changed("core_temperature_K", lambda v: v - 273.15))
    places = {"data": data, "tmp": tmp_path, "model": shipped_model_path("lin2014")}

    code, out, err = bms(*(word.format(**places) for word in COMMANDS[command]))

    assert (code, out) == (2, "")
    assert "core_temperature_K: median" in err
    assert "degrees Celsius" in err
    assert len(err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]


WITHOUT_CORE = "column core_temperature_K"
NO_CHARGE = "no recording charges the cell"
"""Without a core `bms identify` makes a whole preset, and this one is of a discharge alone."""


@needs_cases
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("case", "told"),
    [
        ("30Q_4C_celsius.csv", "degrees Celsius"),
        ("30Q_4C_nocore.csv", WITHOUT_CORE),
        ("30Q_4C_wrong_sign_core_is_surface.csv", "current_A: voltage_V moves with it"),
    ],
)
def test_recordings_that_were_once_taken_are_refused(bms, tmp_path, command, case, told):
    places = {
        "data": SHARED / "cases" / case,
        "tmp": tmp_path,
        "model": shipped_model_path("lin2014"),
    }

    code, out, err = bms(*(word.format(**places) for word in COMMANDS[command]))

    assert (code, out) == (2, "")
    assert (NO_CHARGE if (command, told) == ("identify", WITHOUT_CORE) else told) in err
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def rewritten(folder, recording, **columns):
    values = {name: getattr(recording, name) for name in COLUMNS} | columns
    return write_recording(folder / "run.csv", rows=len(recording.time_s), **values)


def measured(name):
    """Table of a file of ../shared/data with a header."""
    return np.genfromtxt(SHARED / "data" / name, delimiter=",", names=True)


@needs_data
def test_measured_drive_cycle_is_read_and_its_variants_are_refused(tmp_path):
    recording = read_measurements(DRIVE_CYCLE)
    voltage_V = measured(DRIVE_CYCLE.name)["voltage_V"]
    first = slice(0, 1800)
    start = type(recording)(
        **{f.name: getattr(recording, f.name)[first] for f in dataclasses.fields(recording)}
    )
    for change, told in (
        ({"time_s": 1e3 * start.time_s}, "milliseconds"),
        ({"core_temperature_K": start.core_temperature_K - 273.15}, "core_temperature_K"),
        ({"current_A": 1e3 * start.current_A}, "milliampere"),
        ({"current_A": -start.current_A}, "positive while charging"),
        ({"voltage_V": 1e3 * voltage_V[first]}, "millivolt"),
    ):
        columns = {"voltage_V": voltage_V[first], **change}
        with pytest.raises(InputError, match=told):
            read_measurements(rewritten(tmp_path, start, **columns))


@needs_data
def test_measured_charge_is_read(tmp_path):
    """Without a core of its own; the temperature of the surface plus 1 K stands for it."""
    table = measured("a123_26650_cccv_2C.csv")
    table = table[np.diff(table["time_s"], prepend=-1.0) > 0.0]  # two rows have one time
    columns = {name: table[name] for name in table.dtype.names}
    columns |= {
        "core_temperature_K": columns["surface_temperature_K"] + 1.0,
        "cooling_power_W": np.zeros(len(table)),
    }

    read_measurements(write_recording(tmp_path / "run.csv", rows=len(table), **columns))

    columns["current_A"] = -columns["current_A"]
    with pytest.raises(InputError, match="positive while charging"):
        read_measurements(write_recording(tmp_path / "run.csv", rows=len(table), **columns))


@needs_data
@pytest.mark.parametrize("rate", ["c10", "1c", "2c", "4c"])
def test_measured_discharges_are_read_and_refused_when_turned(tmp_path, rate):
    """Their current is negative while discharging: the other way round than here."""
    path = SHARED / "data" / f"samsung_30q_s001_{rate}.csv"
    table = np.genfromtxt(path, delimiter=",", encoding="utf-8-sig")
    columns = {
        "time_s": table[:, 0],
        "current_A": -table[:, 1],
        "voltage_V": table[:, 2],
        "cooling_power_W": np.zeros(len(table)),
        "surface_temperature_K": table[:, 4] + 273.15,
        "coolant_temperature_K": table[:, 6] + 273.15,
        "core_temperature_K": table[:, 4] + 274.15,
    }
    path = tmp_path / "run.csv"

    read_measurements(write_recording(path, rows=len(table), **columns))

    for change, told in (
        ({"current_A": table[:, 1]}, "positive while charging"),
        ({"current_A": -1e3 * table[:, 1]}, "milliampere"),
        ({"time_s": 1e3 * table[:, 0]}, "milliseconds"),
    ):
        with pytest.raises(InputError, match=told):
            read_measurements(write_recording(path, rows=len(table), **columns | change))


@needs_data
@pytest.mark.parametrize("temperature", [20, 40])
def test_measured_pulse_tests_are_read_and_refused_when_turned(tmp_path, temperature):
    table = measured(f"samsung_30q_dnn01_hppc_2c_{temperature}degc.csv")
    columns = {
        "time_s": table["row"] * 1.0,
        "current_A": -table["current"],
        "voltage_V": table["voltage"],
        "cooling_power_W": np.zeros(len(table)),
        "surface_temperature_K": table["temperature"] + 273.15,
        "coolant_temperature_K": np.full(len(table), temperature + 273.15),
        "core_temperature_K": table["temperature"] + 274.15,
    }
    path = tmp_path / "run.csv"

    read_measurements(write_recording(path, rows=len(table), **columns))

    with pytest.raises(InputError, match="positive while charging"):
        read_measurements(
            write_recording(path, rows=len(table), **columns | {"current_A": table["current"]})
        )
