"""A model file is written whole, read back bit for bit, and refused when it is not what it says."""

import dataclasses
import json
import math
import sys

import pytest

from bms.bounds.record import (
    Conformal,
    ErrorBounds,
    Rate,
    TheoremBound,
    WorstCase,
    WorstProfile,
)
from bms.cell.parameters import OpenCircuitVoltage
from bms.data.datasets import simulated_split
from bms.errors import InputError, ModelMismatchError
from bms.kan.accuracy import ErrorFigures
from bms.kan.settings import TrainingSettings
from bms.model.model_file import (
    KanModel,
    SplitErrors,
    TrainingRecord,
    load_model,
    load_shipped_model,
    save_model,
    shipped_model_path,
)
from bms.model.pair import check_pair
from bms.model.restamp import main, restamped
from bms.presets import load_preset, preset_names
from bms.presets.schema import Sensor
from tests.bms.kan_samples import random_network


@pytest.fixture
def model():
    figures = ErrorFigures(0.1, 0.3, -0.01, 500)
    return KanModel(
        1,
        random_network(),
        "some",
        "ab12",
        TrainingRecord(TrainingSettings(), "simulated", None, {"test": 1}),
        {"test": SplitErrors(figures, figures, None)},
        0.4,
        {"estimate": 0.3, "sensors": 0.1},
        ErrorBounds(
            TheoremBound(
                (1, 2, 4),
                (4.0, 0.25, 0.02),
                (0.4, 0.02, 0.002),
                4,
                Rate(1, 4, 5.0, 3.9),
                2,
                0.3,
                0.2,
                0.01,
            ),
            WorstCase(
                0.3,
                0.3,
                0.2,
                WorstProfile(300.0, 0.1, 0.5, None, (-23.0, 0.0), (9.0, 5.0)),
                10.0,
                100,
            ),
            Conformal(0.15, 0.95, 20, "profile"),
            0.28,
        ),
        (1e-7, 2e-7),
    )


def rewritten(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def test_model_comes_back_as_it_was_and_twice_in_the_same_bytes(model, tmp_path):
    save_model(model, tmp_path / "a.json")
    save_model(load_model(tmp_path / "a.json"), tmp_path / "b.json")

    assert load_model(tmp_path / "b.json") == model
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert json.loads((tmp_path / "a.json").read_text())["hash"] == model.hash


def test_hash_changes_with_the_last_bit_of_one_coefficient(model):
    edge = model.network.layers[0][0][0]
    nudged = dataclasses.replace(edge, base_weight=math.nextafter(edge.base_weight, 9.0))
    layer = ((nudged, *model.network.layers[0][0][1:]), *model.network.layers[0][1:])
    network = dataclasses.replace(model.network, layers=(layer, *model.network.layers[1:]))

    assert dataclasses.replace(model, network=network).hash != model.hash


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda c: c["errors"]["test"]["overall"].update(rmse_K=0.01), "hash"),
        (lambda c: c.pop("hash"), "hash"),
        (lambda c: c.pop("network"), "network"),
        (lambda c: c.update(format_version=2), "format_version"),
        (lambda c: c.update(colour="red"), "colour"),
        (lambda c: c["network"].update(degree="3"), "network.degree"),
        (lambda c: c["network"].update(output_center_K=math.nan), "network.output_center_K"),
        (lambda c: c["network"]["input_half_range"].__setitem__(0, 0.0), "input_half_range.0"),
        (lambda c: c["error_bound_parts_K"].update(sensors=0.0), "error_bound_K"),
        (lambda c: c["network"]["layers"][0][0].pop(), "layers"),
        (lambda c: c["edge_error_bounds"].__setitem__(0, 1e-3), "hash"),
        (lambda c: c["edge_error_bounds"].__setitem__(0, -1.0), "edge_error_bounds.0"),
        (lambda c: c["error_bounds"]["worst_case"].update(value_K=0.29), "estimate"),
        (lambda c: c["error_bounds"].update(held_out_K=0.31), "estimate"),
        (lambda c: c["error_bounds"]["conformal"].update(confidence=1.0), "confidence"),
        (lambda c: c["error_bounds"]["conformal"].update(value_K=0.2), "hash"),
        (lambda c: c["error_bounds"]["theorem"]["rate"].update(constant_K=4.0), "hash"),
        (lambda c: c.pop("error_bounds"), "train the model again with 'bms train --preset"),
    ],
)
def test_stale_or_malformed_file_is_refused_by_name_and_key(model, tmp_path, change, told):
    path = tmp_path / "model.json"
    save_model(model, path)
    rewritten(path, change)

    with pytest.raises(InputError) as error:
        load_model(path)

    assert str(path) in str(error.value)
    assert told in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "3", "[" * 100_000, "1" * 5000])
def test_file_that_is_no_model_is_refused(tmp_path, text):
    path = tmp_path / "model.json"
    path.write_text(text)

    with pytest.raises(InputError, match=r"model\.json"):
        load_model(path)


def test_absent_file_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_model(tmp_path / "absent.json")


def test_failed_write_leaves_nothing_behind(model, tmp_path):
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "x").touch()

    for target in (tmp_path / "taken", tmp_path / "absent" / "m.json"):
        with pytest.raises(InputError, match="cannot be written"):
            save_model(model, target)

    assert sorted(path.name for path in tmp_path.rglob("*")) == ["taken", "x"]


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_has_a_model_trained_for_it(name):
    model = load_shipped_model(name)

    assert model.preset == name
    assert model.training_hash == load_preset(name).training_hash
    assert model.network.width == (4, 1, 1)
    assert model.training.settings == TrainingSettings()


@pytest.mark.parametrize("name", preset_names())
def test_shipped_model_reaches_the_papers_rmse_on_unseen_profiles(name):
    errors = load_shipped_model(name).errors["test"]

    assert errors.constant is not None and errors.constant.rmse_K <= 0.0417
    assert errors.dynamic is not None and errors.dynamic.rmse_K <= 0.0417


def test_preset_without_a_model_is_told_how_to_get_one():
    with pytest.raises(InputError, match=r"bms train --preset PRESET\.toml"):
        load_shipped_model("other")


def with_cell(preset, **changes):
    return dataclasses.replace(preset, cell=dataclasses.replace(preset.cell, **changes))


def test_another_open_circuit_voltage_keeps_a_model_and_another_resistance_refuses_it():
    preset, shipped = load_preset("lin2014"), load_shipped_model("lin2014")
    check_pair(with_cell(preset, ocv=OpenCircuitVoltage((0.0, 1.0), (3.0, 3.4))), shipped)
    with pytest.raises(ModelMismatchError, match="another cell"):
        check_pair(with_cell(preset, core_resistance_K_per_W=1.95), shipped)


@pytest.fixture
def from_another_hashing(tmp_path):
    """Path of a shipped model as it was when training hashes were made otherwise."""
    path = tmp_path / "model.json"
    save_model(dataclasses.replace(load_shipped_model("lin2014"), training_hash="0" * 64), path)
    return path


def restamp(monkeypatch, path):
    monkeypatch.setattr(sys, "argv", ["restamp", str(path)])
    main()


@pytest.mark.slow
def test_restamping_makes_a_model_the_shipped_one_again(monkeypatch, from_another_hashing):
    restamp(monkeypatch, from_another_hashing)
    assert from_another_hashing.read_bytes() == shipped_model_path("lin2014").read_bytes()


@pytest.fixture(scope="module")
def test_profiles():
    preset, model = load_preset("lin2014"), load_shipped_model("lin2014")
    return simulated_split(preset, "test", model.training.settings.seed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed_error", "changed_search", "noise", "told"),
    [
        (1e-4, 0.0, 0.005, "error on test profiles"),
        (0.0, 1e-5, 0.005, "error that a search finds"),
        (0.0, 0.0, 0.006, "error bound"),
    ],
)
def test_a_model_of_something_else_is_not_restamped(
    monkeypatch,
    capsys,
    from_another_hashing,
    test_profiles,
    changed_error,
    changed_search,
    noise,
    told,
):
    """Each of the three figures is looked at; the search, which takes long, gives what it did."""
    preset, before = load_preset("lin2014"), from_another_hashing.read_bytes()
    sensors = dataclasses.replace(preset.sensors, current_A=Sensor(0.005, noise, 0.0))
    recorded = load_shipped_model("lin2014").error_bounds.worst_case
    searched = dataclasses.replace(recorded, value_K=recorded.value_K + changed_search)
    profiles = {
        kind: dataclasses.replace(
            samples, core_temperature_K=samples.core_temperature_K + changed_error
        )
        for kind, samples in test_profiles.items()
    }
    for name, result in (
        ("load_preset", dataclasses.replace(preset, sensors=sensors)),
        ("simulated_split", profiles),
        ("worst_case", searched),
    ):
        monkeypatch.setattr(f"bms.model.restamp.{name}", lambda *_, result=result: result)
    with pytest.raises(SystemExit) as stop:
        restamp(monkeypatch, from_another_hashing)
    told_line = capsys.readouterr().err
    assert stop.value.code == 2
    assert f"model.json: {told}: preset 'lin2014' gives another one" in told_line
    assert told_line.count("\n") == 1
    assert from_another_hashing.read_bytes() == before


def test_a_model_of_measurements_has_no_training_hash_to_renew(model):
    with pytest.raises(InputError, match="trained on measurements"):
        restamped(dataclasses.replace(model, training_hash=None), load_preset("lin2014"))
