"""`bms compare-estimators` as a user calls it, and what it says about the figures."""

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from bms.data.measurements import COLUMNS, read_measurements
from bms.kan.accuracy import ErrorFigures
from bms.model.model_file import load_shipped_model, save_model, shipped_model_path
from bms.presets import DEFAULT_PRESET
from bms.studies.rivals.comparison import Comparison, Row, Trace
from bms.studies.rivals.estimator import Cost
from bms.studies.rivals.verdict import AT_THE_FLOOR, verdict
from tests.bms.rival_samples import charge

KEYS = {
    "name", "given", "errors", "rmse_with_sensor_errors_K", "parameters", "bytes",
    "multiply_adds", "time_per_estimate_ns", "remark",
}  # fmt: skip
MEASURED = Path(__file__).parents[3] / "shared" / "data" / "a123_26650_hev_cycle_1.csv"
QUICK = ["--quick", "--profiles", 1]


@pytest.fixture
def recording(tmp_path):
    samples = charge(rows=600)
    values = np.column_stack([samples.time_s, samples.inputs, samples.core_temperature_K])
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in values.tolist())]
    path = tmp_path / "charge.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def without_times(result):
    for row in result["estimators"]:
        row.pop("time_per_estimate_ns")
    return result


def by_name(result, word):
    rows = [row for row in result["estimators"] if word in row["name"]]
    (row,) = [row for row in rows if row["name"] == word] or rows
    return row


def test_simulated_profiles_give_figures_by_kind_and_a_chart(bms, tmp_path):
    code, out, err = bms(
        "compare-estimators", "--preset", DEFAULT_PRESET, *QUICK, "--json",
        "--out", tmp_path / "new" / "folder",
    )  # fmt: skip

    result = json.loads(out)
    assert (code, err) == (0, "")
    assert json.loads((tmp_path / "new/folder/estimators.json").read_text()) == result
    assert (tmp_path / "new/folder/estimators.png").read_bytes().startswith(b"\x89PNG")
    assert {frozenset(row) for row in result["estimators"]} == {frozenset(KEYS)}
    for row in result["estimators"]:
        parts = row["errors"]
        total = sum(parts[kind]["samples"] for kind in ("constant", "dynamic"))
        squares = sum(
            parts[kind]["samples"] * parts[kind]["rmse_K"] ** 2 for kind in ("constant", "dynamic")
        )
        assert parts["all"]["samples"] == total
        assert parts["all"]["rmse_K"] == pytest.approx((squares / total) ** 0.5)
        assert row["rmse_with_sensor_errors_K"] > 0.0


def test_the_same_command_gives_the_same_figures_but_for_the_times(bms, recording):
    command = ("compare-estimators", "--data", recording, "--cell", "lin2014", "--quick", "--json")

    one, other = (without_times(json.loads(bms(*command)[1])) for _ in range(2))

    assert one == other


def test_filter_that_knows_the_cell_stays_within_its_uncertainty(bms):
    out = bms("compare-estimators", "--preset", "lin2014", *QUICK, "--json")[1]

    result = json.loads(out)
    for name in ("steady", "full"):
        assert by_name(result, name)["errors"]["all"]["max_abs_error_K"] < 0.02
    assert by_name(result, "extended")["given"] == "the true cell, not R0"


def test_recording_is_judged_by_its_last_third(bms, recording):
    code, out, err = bms("compare-estimators", "--data", recording, "--quick", "--json")

    result = json.loads(out)
    assert code == 0
    assert f"train one with 'bms train --data {recording} --lagged" in err
    for row in result["estimators"]:
        assert row["errors"]["fitted two thirds"]["samples"] == 400
        assert row["errors"]["last third"]["samples"] == 200
        assert row["rmse_with_sensor_errors_K"] is None
    # The recording comes from the model that is fitted to it.
    assert by_name(result, "tuned")["errors"]["last third"]["rmse_K"] < 0.01


@pytest.mark.long("training")
@pytest.mark.skipif(not MEASURED.is_file(), reason=f"not run: {MEASURED} is absent")
def test_on_measured_temperatures_a_linear_map_beats_the_filters(bms):
    out = bms(
        "compare-estimators", "--data", MEASURED, "--cell", "lin2014", "--quick", "--json"
    )[1]  # fmt: skip

    result = json.loads(out)
    recording = read_measurements(MEASURED).samples()
    terms = np.hstack([recording.inputs, np.ones((5430, 1))])
    first, last = slice(3620), slice(3620, None)
    core_K = recording.core_temperature_K
    solution = np.linalg.lstsq(terms[first], core_K[first], rcond=None)[0]
    expected_K = np.sqrt(np.mean((terms[last] @ solution - core_K[last]) ** 2))
    linear_K = by_name(result, "least squares")["errors"]["last third"]["rmse_K"]
    tuned_K = by_name(result, "tuned")["errors"]["last third"]["rmse_K"]
    assert linear_K == pytest.approx(expected_K, abs=1e-4) == pytest.approx(0.05, abs=1e-4)
    assert linear_K < tuned_K < by_name(result, "full")["errors"]["last third"]["rmse_K"] < 0.11
    assert result["verdict"][0].startswith("Smallest RMSE: least squares")


def test_network_of_another_cell_is_shown_with_a_warning(bms, recording):
    stranger = shipped_model_path(DEFAULT_PRESET)

    code, out, err = bms(
        "compare-estimators", "--data", recording, "--model", stranger, "--cell", "lin2014",
        "--quick",
    )  # fmt: skip

    assert code == 0
    assert f"KAN ({DEFAULT_PRESET})" in out
    assert f"KAN ({DEFAULT_PRESET}) was not trained on charge.csv" in err


def test_network_with_other_inputs_is_refused(bms, tmp_path):
    loaded = load_shipped_model("lin2014")
    network = dataclasses.replace(loaded.network, input_names=("a", "b", "c", "d"))
    save_model(dataclasses.replace(loaded, network=network), tmp_path / "other.json")

    code, _, err = bms(
        "compare-estimators", "--preset", "lin2014", "--model", tmp_path / "other.json"
    )

    assert code == 2
    assert "other.json: input_names: must begin with current_A" in err


def test_without_scikit_learn_the_floor_says_why_it_is_missing(bms, monkeypatch, recording):
    monkeypatch.setitem(sys.modules, "sklearn.ensemble", None)

    command = ("compare-estimators", "--data", recording, "--cell", "lin2014", "--quick")
    code, out, _ = bms(*command, "--json")

    floor = by_name(json.loads(out), "floor")
    assert code == 0
    assert "floor: not run: scikit-learn is not installed" in bms(*command)[1]
    assert floor["errors"] == {}
    assert floor["remark"].startswith("not run: scikit-learn is not installed")


def test_networks_are_trained_on_a_plant_that_no_preset_describes(bms):
    """The filters, which go by the cell's own law of cooling, know nothing of it."""
    arguments = ("compare-estimators", "--preset", DEFAULT_PRESET, *QUICK, "--json")
    code, out, err = bms(*arguments, "--cooling", "free-convection")

    result = json.loads(out)
    assert (code, result["warnings"]) == (0, [])
    assert "warning" not in err
    assert "free-convection" in result["data"]
    assert [row["name"] for row in result["estimators"]][:2] == ["KAN", "lagged KAN"]
    ignorant = by_name(result, "steady gain")
    assert ignorant["given"] == "the cell as its model has it"
    assert 0.05 < ignorant["errors"]["all"]["rmse_K"] < 1.0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "give either --preset NAME or --data CSV"),
        (["--preset", "lin2014", "--data", "x.csv"], "give either --preset NAME or --data CSV"),
        (["--data", "x.csv"], "x.csv"),
        (["--data", "x.csv", "--profiles", "3"], "--profiles belongs to --preset"),
        (["--preset", "lin2014", "--cell", "lin2014"], "--cell belongs to --data"),
        (["--data", "x.csv", "--cooling", "free-convection"], "--cooling belongs to --preset"),
        (
            ["--preset", "lin2014", "--cooling", "free-convection", "--model", "x.json"],
            "--model was trained on another plant",
        ),
        (["--preset", "lin2014", "--cooling", "none"], "'linear', 'free-convection'"),
        (["--preset", "nonsense"], "nonsense"),
        (["--preset", "lin2014", "--model", "absent.json"], "absent.json"),
    ],
)
def test_wrong_use_is_refused_in_one_line(bms, arguments, told):
    code, out, err = bms("compare-estimators", *arguments)

    assert (code, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1


def test_uneven_sampling_is_refused_with_the_row(bms, recording):
    lines = recording.read_text().splitlines()
    recording.write_text("\n".join(lines[:300] + lines[301:]) + "\n")

    code, _, err = bms("compare-estimators", "--data", recording, "--quick")

    assert code == 2
    assert "time_s: the step to row 300 is 2.2 s and not 1.1 s" in err


def row(name, role, rmse_K, multiply_adds, read_rmse_K=None):
    figures = ErrorFigures(rmse_K, 2 * rmse_K, 0.0, 10)
    cost = None if role == "floor" else Cost(1, 4 * multiply_adds, multiply_adds)
    given = "the cell" if role == "filter" else "data"
    static = role != "filter"
    return Row(name, role, static, given, {"all": figures}, "all", read_rmse_K, cost, None)


def said(*rows):
    return "\n".join(verdict(Comparison("t", rows, Trace("", np.zeros(0), {}))))


def test_verdict_names_the_best_whoever_it_is():
    kan, kalman = row("KAN", "kan", 0.02, 45), row("Kalman", "filter", 0.01, 11)
    linear = row("linear", "linear", 0.03, 4)

    text = said(kan, kalman, linear)

    assert "Smallest RMSE: Kalman, 0.0100 K; it is given the cell." in text
    assert "the best is KAN, 0.0200 K, 2.0 times as much" in text
    assert "Cheapest: linear, 4 multiply-adds" in text
    assert (
        "KAN: place 2 of 3 by RMSE, 0.0200 K; as accurate or better at no higher cost: Kalman."
        in text
    )

    better = said(row("KAN", "kan", 0.005, 45), kalman, linear)
    assert "Smallest RMSE: KAN, 0.0050 K; it is given data." in better
    assert "the filters the best is Kalman, 0.0100 K, 2.0 times" in better
    assert (
        "place 1 of 3 by RMSE, 0.0050 K; nothing else is as accurate at no higher cost." in better
    )


def test_verdict_on_readings_may_differ_from_that_on_the_truth():
    text = said(
        row("KAN", "kan", 0.01, 45, read_rmse_K=0.05),
        row("Kalman", "filter", 0.02, 11, read_rmse_K=0.03),
        row("linear", "linear", 0.03, 4, read_rmse_K=0.04),
    )

    assert "Smallest RMSE: KAN" in text
    assert "sensors the smallest RMSE is that of Kalman, 0.0300 K" in text


@pytest.mark.parametrize(
    ("ratio", "place"),
    [(0.9, "at the floor"), (AT_THE_FLOOR - 0.001, "at the floor"), (1.2, "above the floor")],
)
def test_network_is_held_to_the_best_other_map_of_the_same_inputs(ratio, place):
    linear, floor = row("linear", "linear", 0.03, 4), row("floor: trees", "floor", 0.01, 1)
    kan = row("KAN", "kan", 0.01 * ratio, 45)

    text = said(kan, row("Kalman", "filter", 0.001, 11), linear, floor)

    assert f"KAN is {place} of static maps" in text
    assert f"{ratio:.2f} times the 0.0100 K of the best other map of the same inputs, trees" in text
