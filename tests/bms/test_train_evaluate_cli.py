"""`bms train` and `bms evaluate` as a user calls them."""

import json
import math

import numpy as np
import pytest

from bms.data.datasets import simulated_split
from bms.data.lags import Lag
from bms.data.measurements import read_measurements
from bms.data.profiles import draw_profiles
from bms.data.simulate import simulate
from bms.model.model_file import load_model, load_shipped_model, shipped_model_path
from bms.presets import DEFAULT_PRESET, load_preset, one_cell_preset_names
from tests.bms.kan_samples import write_recording

KEYS = {"rmse_K", "max_abs_error_K", "bias_K", "samples", "extrapolated_samples"}
QUICK = ["--epochs", "3", "--refinement-steps", "20"]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("data") / "run.csv", rows=600)


@pytest.mark.long("training")
def test_retraining_the_default_reproduces_the_shipped_errors(bms, tmp_path):
    code, out, _ = bms("train", "--preset", DEFAULT_PRESET, "--out", tmp_path / "model.json")

    assert code == 0
    retrained, shipped = load_model(tmp_path / "model.json"), load_shipped_model(DEFAULT_PRESET)
    assert retrained.hash[:8] in out
    for kind in ("constant", "dynamic", "overall"):
        ours = getattr(retrained.errors["test"], kind)
        theirs = getattr(shipped.errors["test"], kind)
        assert ours.rmse_K == pytest.approx(theirs.rmse_K, rel=0.05)
        assert ours.max_abs_error_K == pytest.approx(theirs.max_abs_error_K, rel=0.05)
    assert retrained.error_bound_K == pytest.approx(shipped.error_bound_K, rel=0.05)


def test_model_trained_on_a_recording_knows_which(bms, recording, tmp_path):
    path = tmp_path / "model.json"

    code, _, _ = bms(
        "train", "--data", recording, "--out", path, "--seed", 7, "--width", "4,2,1",
        "--grid", 3, "--degree", 2, *QUICK,
    )  # fmt: skip

    model = load_model(path)
    assert code == 0
    assert model.network.width == (4, 2, 1)
    assert model.network.degree == 2
    assert len(model.network.layers[0][0][0].coefficients) == 3 + 2
    assert model.training.settings.seed == 7
    assert model.training.data == "run.csv"
    assert [item.name for item in tmp_path.iterdir()] == ["model.json"]


@pytest.mark.parametrize("engine", ["c", "python"])
def test_evaluation_prints_json_with_the_errors_of_every_row(bms, recording, tmp_path, engine):
    model_path = tmp_path / "model.json"
    bms("train", "--data", recording, "--out", model_path, *QUICK)
    hot = write_recording(
        tmp_path / "hot.csv",
        rows=200,
        surface_temperature_K=(np.linspace(300.0, 340.0, 200)).tolist(),
    )

    code, out, _ = bms(
        "evaluate", "--model", model_path, "--data", hot, "--engine", engine, "--json"
    )

    result = json.loads(out)
    samples = read_measurements(hot).samples()
    estimate_K, in_domain = load_model(model_path).network.evaluate(samples.inputs)
    error_K = estimate_K - samples.core_temperature_K
    assert code == 0
    assert set(result) == KEYS
    assert result["rmse_K"] == pytest.approx(math.sqrt(np.mean(error_K**2)), abs=1e-3)
    assert result["max_abs_error_K"] == pytest.approx(np.abs(error_K).max(), abs=1e-3)
    assert result["bias_K"] == pytest.approx(error_K.mean(), abs=1e-3)
    assert result["samples"] == 200
    assert result["extrapolated_samples"] == np.count_nonzero(~in_domain) > 0


def test_shipped_model_holds_the_papers_rmse_on_profiles_drawn_anew(bms):
    code, out, _ = bms(
        "evaluate", "--model", shipped_model_path(DEFAULT_PRESET), "--preset", DEFAULT_PRESET,
        "--engine", "python", "--json",
    )  # fmt: skip

    result = json.loads(out)
    assert code == 0
    assert result["rmse_K"] <= 0.0417
    assert result["extrapolated_samples"] == 0
    assert result["max_abs_error_K"] <= load_shipped_model(DEFAULT_PRESET).error_bound_K


def test_lagged_model_of_a_recording_is_the_same_in_c_with_its_own_filters(
    bms, recording, tmp_path
):
    """A core that only its past explains: the static model cannot follow, the lagged one can."""
    data = read_measurements(recording)
    filtered = data.samples((Lag("current_squared_A2", 20.0),)).inputs[:, 4]
    delayed = write_recording(
        tmp_path / "delayed.csv",
        rows=len(data.time_s),
        core_temperature_K=(data.surface_temperature_K + 0.01 * filtered).tolist(),
    )
    rmse_K = {}
    for name, options in {"static": [], "lagged": ["--lag-time-constants", "20"]}.items():
        model_path = tmp_path / f"{name}.json"
        assert bms("train", "--data", delayed, "--out", model_path, *options)[0] == 0
        for engine in ("c", "python"):
            _, out, _ = bms(
                "evaluate", "--model", model_path, "--data", delayed, "--engine", engine, "--json"
            )
            rmse_K[name, engine] = json.loads(out)["rmse_K"]
    assert rmse_K["lagged", "c"] == pytest.approx(rmse_K["lagged", "python"], abs=2e-4)
    assert rmse_K["lagged", "c"] < 0.05 * rmse_K["static", "c"]
    model = load_model(tmp_path / "lagged.json")
    assert model.network.width == (6, 1, 1)
    assert model.network.input_names[4:] == (
        "current_squared_A2_filtered_20s",
        "surface_temperature_rise_K_filtered_20s",
    )


def test_lagged_without_constants_takes_those_of_the_kind_of_data(bms, recording, tmp_path):
    bms("train", "--data", recording, "--out", tmp_path / "model.json", "--lagged")
    assert load_model(tmp_path / "model.json").training.settings.lag_time_constants_s == (10, 160)


@pytest.mark.parametrize("preset", one_cell_preset_names())
def test_shipped_models_hold_the_promised_accuracy_on_whole_unseen_profiles(preset):
    """Half a dynamic error and a tenth of a kelvin at full steps is what remembering must bring."""
    chosen = load_preset(preset)
    rmse_K = {}
    for lagged in (False, True):
        network = load_model(shipped_model_path(preset, lagged)).network
        for kind, samples in simulated_split(chosen, "evaluation", 0, lags=network.lags).items():
            error_K = network.evaluate(samples.inputs)[0] - samples.core_temperature_K
            rmse_K[lagged, kind] = math.sqrt(np.mean(error_K**2))
    assert rmse_K[False, "constant"] <= 0.02
    assert rmse_K[False, "dynamic"] <= 0.04
    assert rmse_K[True, "dynamic"] <= 0.5 * rmse_K[False, "dynamic"]
    rng = np.random.default_rng(77)
    steps = simulate(chosen, draw_profiles(chosen, "steps", 30, rng), rng, network.lags)
    error_K = network.evaluate(steps.inputs)[0] - steps.core_temperature_K
    assert np.abs(error_K).max() <= 0.1


def test_table_without_json_names_every_figure(bms, recording, tmp_path):
    bms("train", "--data", recording, "--out", tmp_path / "model.json", *QUICK)

    code, out, _ = bms(
        "evaluate", "--model", tmp_path / "model.json", "--data", recording, "--engine", "python"
    )

    assert code == 0
    assert all(key in out for key in KEYS)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["train", "--out", "{tmp}/m.json"], "either --preset NAME or --data CSV"),
        (["train", "--preset", "x", "--data", "{data}", "--out", "{tmp}/m.json"], "either"),
        (["train", "--preset", "nobody", "--out", "{tmp}/m.json"], "nobody"),
        (["train", "--data", "{tmp}/absent.csv", "--out", "{tmp}/m.json"], "absent.csv"),
        (["train", "--data", "{data}", "--out", "{tmp}/absent/m.json"], "cannot be written"),
        (["train", "--data", "{data}", "--out", "{data}/m.json"], "cannot be written"),
        (["train", "--data", "{data}", "--out", "{tmp}"], "cannot be written"),
        (["train", "--data", "{data}", "--out", "{tmp}/m.json", "--width", "4;1"], "4;1"),
        (["train", "--data", "{data}", "--out", "{tmp}/m.json", "--width", "3,1"], "width"),
        (["train", "--data", "{data}", "--out", "{tmp}/m.json", "--width", "4,2"], "end in 1"),
        (["train", "--data", "{data}", "--out", "{tmp}/m.json", "--grid", "0"], "grid"),
        (
            ["train", "--data", "{data}", "--out", "{tmp}/m.json", "--lag-time-constants", "1,-2"],
            "lag_time_constants_s",
        ),
        (
            ["train", "--data", "{data}", "--out", "{tmp}/m.json", "--lagged", "--width", "4,1,1"],
            "must begin with 8",
        ),
        (["train", "--data", "{data}", "--out", "{tmp}/m.json", "--seed", "-1"], "seed"),
        (["train", "--preset", "lin2014"], "--out"),
        (["evaluate", "--model", "{model}"], "either --preset NAME or --data CSV"),
        (["evaluate", "--model", "{model}", "--preset", "paper_calibrated"], "lin2014"),
        (["evaluate", "--model", "{data}", "--data", "{data}"], "not valid JSON"),
        (["evaluate", "--model", "{model}", "--data", "{model}"], "column time_s"),
        (["evaluate", "--model", "{model}", "--data", "{data}", "--engine", "gpu"], "gpu"),
    ],
)
def test_wrong_use_is_one_line_on_stderr_and_exit_2(bms, recording, tmp_path, arguments, told):
    places = {"tmp": tmp_path, "data": recording, "model": shipped_model_path("lin2014")}

    code, out, err = bms(*(argument.format(**places) for argument in arguments))

    assert code == 2
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["train", "evaluate"])
def test_help_explains_units_and_gives_an_example(bms, command):
    code, out, _ = bms(command, "--help")

    assert code == 0
    assert "Example: bms" in out
    assert "negative while charging" in " ".join(out.replace("│", " ").split())


def test_preset_with_another_cell_is_refused_with_the_command_to_train(bms, tmp_path):
    preset = load_preset("lin2014")
    text = (shipped_model_path("lin2014").parents[1] / "presets" / "lin2014.toml").read_text()
    capacity = f"capacity_Ah = {preset.cell.capacity_Ah}"
    assert capacity in text
    (tmp_path / "mine.toml").write_text(text.replace(capacity, "capacity_Ah = 2.5"))

    code, _, err = bms(
        "evaluate", "--model", shipped_model_path("lin2014"), "--preset", tmp_path / "mine.toml"
    )

    assert code == 2
    assert "bms train --preset" in err
