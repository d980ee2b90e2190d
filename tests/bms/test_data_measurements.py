"""Recordings are read exactly, or refused with file, line and remedy."""

import numpy as np
import pytest

from bms.data.measurements import COLUMNS, read_measurements
from bms.errors import InputError
from tests.bms.kan_samples import write_recording

HEADER = ",".join(COLUMNS)
ROW = "0.0,-1.5,0.25,300.5,299,301"


def written(path, *lines, newline="\n"):
    path.write_bytes(newline.join([*lines, ""]).encode())
    return path


def test_columns_are_found_by_name_in_any_order_and_others_ignored(tmp_path):
    path = written(
        tmp_path / "a.csv",
        "note,core_temperature_K,current_A,time_s,coolant_temperature_K,"
        "surface_temperature_K,cooling_power_W",
        "hot,301,-1.5,0,299,300.5,0.25",
        "hot,302,-2.5,1e0,298,300.75,0.5",
    )

    recording = read_measurements(path)

    assert recording.time_s.tolist() == [0.0, 1.0]
    assert recording.core_temperature_K.tolist() == [301.0, 302.0]
    np.testing.assert_array_equal(
        recording.samples().inputs, [[-1.5, 0.25, 300.5, 299.0], [-2.5, 0.5, 300.75, 298.0]]
    )


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("start", ["", "\ufeff"])
def test_line_ends_byte_order_mark_and_blank_lines_do_not_matter(tmp_path, newline, start):
    path = written(tmp_path / "a.csv", start + HEADER, ROW, "", newline=newline)

    assert read_measurements(path).surface_temperature_K.tolist() == [300.5]


@pytest.mark.parametrize("column", range(len(COLUMNS)))
@pytest.mark.parametrize("text", ["nan", "inf", "-Infinity", "warm", "", "1,5", "1_0"])
def test_value_that_is_no_finite_number_is_named_with_its_line(tmp_path, column, text):
    cells = ["1.0", *ROW.split(",")[1:]]
    cells[column] = text
    path = written(tmp_path / "a.csv", HEADER, ROW, ",".join(cells))

    with pytest.raises(InputError, match=r"a\.csv:3: .*mend"):
        read_measurements(path)


@pytest.mark.parametrize("missing", COLUMNS)
def test_missing_column_is_named(tmp_path, missing):
    header = HEADER.replace(missing, "other")
    path = written(tmp_path / "a.csv", header, ROW)

    with pytest.raises(InputError, match=rf"a\.csv:1: column {missing}"):
        read_measurements(path)


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ([], r"a\.csv:1: column time_s"),
        ([HEADER], "no measurement"),
        ([HEADER, ROW, ROW], r"a\.csv:3: time_s must rise.*remove one of the two"),
        ([HEADER, ROW, "-1" + ROW[3:]], r"a\.csv:3: time_s must rise.*sort"),
        ([HEADER.replace(",", ";"), ROW.replace(",", ";")], r"a\.csv:1: .*separated by ';'"),
        ([HEADER.replace(",", "\t"), ROW], r"a\.csv:1: .*separated by tabulators"),
        ([HEADER, ROW + ",9"], r"a\.csv:2: 7 values"),
        ([HEADER, ROW, "1.0,2.0"], r"a\.csv:3: 2 values"),
        ([HEADER + ",time_s", ROW + ",5"], r"a\.csv:1: column time_s"),
        ([HEADER, "0" * 200_000 + ROW], r"a\.csv: not valid CSV"),
        (["x" * 200_000, ROW], r"a\.csv: not valid CSV"),
    ],
)
def test_empty_unsorted_and_ragged_files_are_refused(tmp_path, lines, told):
    with pytest.raises(InputError, match=told):
        read_measurements(written(tmp_path / "a.csv", *lines))


def test_binary_and_absent_files_are_refused(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00\x01")
    for name in ("a.csv", "absent.csv"):
        with pytest.raises(InputError, match=name):
            read_measurements(tmp_path / name)


def test_recording_of_many_rows_comes_back_exactly(tmp_path):
    core_K = 300.0 + np.random.default_rng(0).normal(size=500)

    recording = read_measurements(
        write_recording(tmp_path / "a.csv", rows=500, core_temperature_K=core_K.tolist())
    )

    np.testing.assert_array_equal(recording.core_temperature_K, core_K)
