"""A model that does not know how a charge begins is refused before it is flashed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bms.identification.preset_toml import preset_toml
from bms.kan.domain import EVERYWHERE
from bms.model.model_file import KanModel, load_shipped_model, save_model
from bms.model.start import unknown_start
from bms.presets import Preset, load_preset
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

PRESET = load_preset("lin2014")
CONSTANT_COOLING_W = 0.0
KNOWN_W = 0.5
"""Half of the range that training gives a channel which does not vary."""


def measured() -> KanModel:
    """As of a recording whose cooling is constant: the shipped network with such a range."""
    model = load_shipped_model("lin2014")
    network = replace(
        model.network,
        input_center=(
            model.network.input_center[0], CONSTANT_COOLING_W, *model.network.input_center[2:],
        ),
        input_half_range=(
            model.network.input_half_range[0], KNOWN_W, *model.network.input_half_range[2:],
        ),
        domain=EVERYWHERE,
    )  # fmt: skip
    return replace(model, network=network, preset=None, training_hash=None, error_bounds=None)


def starting(cooling_W: float, temperature_K: float = 298.15) -> Preset:
    initial = replace(PRESET.initial, cooling_power_W=cooling_W, temperature_K=temperature_K)
    return replace(PRESET, initial=initial)


def charges(preset: Preset) -> bool:
    """Whether any current flows in the first seconds, by the firmware itself."""
    settings = Settings(preset, model=measured(), max_time_s=3.0)
    return run_both(settings).summary.final_soc > preset.initial.soc


@pytest.mark.parametrize(
    ("preset", "named"),
    [
        (starting(0.45), None),
        (starting(0.55), "cooling_power_W from -0.5 to 0.5"),
        (starting(1.0), "cooling_power_W from -0.5 to 0.5"),
        (starting(0.0, 283.5), None),
        (starting(0.0, 282.5), "surface_temperature_K"),
    ],
)
def test_a_start_is_refused_exactly_where_the_firmware_gives_no_current(preset, named):
    found = unknown_start(preset, measured())
    assert (found is None) == (named is None) == charges(preset)
    assert found is None or named in found.reason


def written(folder: Path, preset: Preset) -> tuple[Path, Path]:
    paths = folder / "cell.toml", folder / "model.json"
    paths[0].write_text(preset_toml(preset), encoding="utf-8")
    save_model(measured(), paths[1])
    return paths


def test_verify_and_export_refuse_a_model_of_a_recording_with_constant_cooling(bms, tmp_path):
    preset, model = written(tmp_path, starting(1.0))
    code, out, _ = bms("verify", "--preset", preset, "--model", model, "--json")
    told = json.loads(out)
    assert (code, told["certified"]) == (1, False)
    assert "knows cooling_power_W from -0.5 to 0.5 only" in told["refusals"]["estimate"]["reason"]

    code, _, err = bms("export", "--preset", preset, "--model", model, "--out", tmp_path / "c")
    assert (code, err.count("\n")) == (2, 1)
    assert "knows cooling_power_W from -0.5 to 0.5 only" in err
    assert not (tmp_path / "c").exists()


def test_a_family_goes_on_by_its_observer():
    assert unknown_start(load_preset("a123_26650"), measured()) is None


@pytest.mark.parametrize("name", ["lin2014", "paper_calibrated"])
def test_shipped_models_know_their_start(name):
    assert unknown_start(load_preset(name), load_shipped_model(name)) is None
