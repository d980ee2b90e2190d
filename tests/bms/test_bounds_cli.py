"""`bms bound` as a user calls it, and what training writes into the model."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from bms.bounds.derive import SEARCH_SPREAD_K, bounds_for_recording, error_bound_parts_K
from bms.data.datasets import split_by_time
from bms.data.measurements import read_measurements
from bms.model.model_file import load_model, load_shipped_model, save_model, shipped_model_path
from bms.presets import one_cell_preset_names
from tests.bms.kan_samples import write_recording

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("data") / "run.csv", rows=600)


@pytest.fixture
def trained(bms, recording, tmp_path):
    path = tmp_path / "model.json"
    code, _, _ = bms(
        "train", "--data", recording, "--out", path, "--epochs", 3, "--refinement-steps", 20
    )
    assert code == 0
    return path


def lowered(path, share):
    """The model with a smaller error bound, whole and with a hash of its own."""
    model = load_model(path)
    parts_K = {**model.error_bound_parts_K, "arithmetic": 0.0}
    bounds = replace(
        model.error_bounds,
        held_out_K=share * model.error_bounds.held_out_K,
        conformal=replace(model.error_bounds.conformal, value_K=0.0),
        worst_case=None,
    )
    parts_K["estimate"] = bounds.used_K
    save_model(
        replace(
            model,
            error_bounds=bounds,
            error_bound_parts_K=parts_K,
            error_bound_K=math.fsum(parts_K.values()),
        ),
        path,
    )


def test_model_of_a_recording_is_found_as_it_states(bms, recording, trained, tmp_path):
    code, out, _ = bms(
        "bound", "--model", trained, "--data", recording, "--out", tmp_path / "o", "--json"
    )

    result = json.loads(out)
    model = load_model(trained)
    _, held_out = split_by_time(read_measurements(recording).samples())
    error_K = model.network.evaluate(held_out.inputs)[0] - held_out.core_temperature_K
    assert code == 0
    assert result["holds"] is True
    assert result["error_bound_K"] == pytest.approx(model.error_bound_K)
    assert result["held_out_K"] == pytest.approx(np.abs(error_K).max())
    assert result["worst_case"] is None
    assert result["conformal"]["unit"] == "block"
    assert result["conformal"]["units"] == 19
    assert set(result["parts_K"]) == {"estimate", "arithmetic"}
    assert json.loads((tmp_path / "o" / "bound.json").read_text()) == result
    assert (tmp_path / "o" / "bound.png").read_bytes().startswith(PNG_SIGNATURE)


def test_model_that_states_too_little_is_found_out(bms, recording, trained):
    lowered(trained, 0.5)

    code, out, _ = bms("bound", "--model", trained, "--data", recording)

    assert code == 1
    assert "TOO SMALL" in out


def test_another_recording_counts_as_a_whole(bms, trained, tmp_path):
    rows = 400
    surface_K = 300.0 + np.sin(np.arange(rows) / 40.0)
    other = write_recording(
        tmp_path / "other.csv",
        rows=rows,
        surface_temperature_K=surface_K.tolist(),
        core_temperature_K=[300.0] * 5 + [340.0] * 5 + [301.0] * (rows - 10),
    )

    code, out, _ = bms("bound", "--model", trained, "--data", other, "--json")

    assert code == 1
    assert json.loads(out)["held_out_K"] > 20.0


def test_confidence_that_a_recording_cannot_give_is_refused(bms, trained, tmp_path):
    short = write_recording(tmp_path / "short.csv", rows=50)

    code, _, err = bms("bound", "--model", trained, "--data", short, "--confidence", 0.99)

    assert code == 2
    assert "at least 99" in err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), "--data"),
        (("--preset", "lin2014", "--data", "x.csv"), "not both"),
        (("--data", "absent.csv"), "absent.csv"),
    ],
)
def test_wrong_use_is_one_line(bms, trained, arguments, told):
    code, _, err = bms("bound", "--model", trained, *arguments)

    assert code == 2
    assert told in err
    assert err.count("\n") == 1


@pytest.mark.long("training")
def test_shipped_default_is_found_as_it_states(bms, tmp_path):
    code, out, _ = bms("bound", "--model", shipped_model_path("paper_calibrated"), "--json")

    result = json.loads(out)
    stated = load_shipped_model("paper_calibrated")
    assert code == 0
    assert result["error_bound_K"] == pytest.approx(stated.error_bound_K, rel=0.05)
    assert result["theorem"]["grids"][-1] == 32


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_shipped_model_records_all_three_and_uses_the_largest(name):
    model = load_shipped_model(name)
    bounds = model.error_bounds

    assert bounds is not None
    assert bounds.worst_case is not None
    assert bounds.theorem.rate is not None
    assert bounds.theorem.rate.exponent >= 3.0
    assert bounds.theorem.rate.last_grid == 32
    assert bounds.conformal.unit == "profile"
    assert bounds.conformal.confidence == 0.95
    assert bounds.used_K == max(bounds.worst_case.value_K, bounds.held_out_K)
    assert bounds.used_K >= bounds.conformal.value_K
    assert model.error_bound_parts_K["estimate"] == bounds.used_K
    assert model.error_bound_parts_K["search"] == SEARCH_SPREAD_K
    assert len(model.edge_error_bounds) == sum(
        len(row) for la in model.network.layers for row in la
    )


def test_without_a_cell_model_the_largest_held_out_error_is_used(recording, trained):
    network = load_model(trained).network
    training, held_out = split_by_time(read_measurements(recording).samples())

    bounds = bounds_for_recording(network, training, held_out, 0, confidence=0.5)

    assert bounds.conformal.value_K <= bounds.held_out_K
    assert (bounds.used, bounds.used_K) == ("held_out", bounds.held_out_K)
    parts_K = error_bound_parts_K(network, bounds, held_out, None)
    assert parts_K["estimate"] == bounds.held_out_K
    assert 0.0 < parts_K["arithmetic"] < 1e-3
