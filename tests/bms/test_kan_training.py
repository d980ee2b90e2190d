"""Training is reproducible, learns, and reports errors that an independent evaluation finds."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from bms.bounds.readings import measurement_error_K
from bms.bus_signals import BusQuantisation
from bms.data.datasets import PROFILES_OF_EACH_KIND, simulated_split, simulated_splits
from bms.data.simulate import Samples, joined
from bms.errors import InputError
from bms.kan.accuracy import error_figures
from bms.kan.additive import additive_layers
from bms.kan.scaling import Scaling
from bms.kan.settings import TrainingSettings
from bms.kan.training import mean_square, penalised_epochs, refined, train_network
from bms.model.make import model_for_measurements, model_for_preset
from bms.model.model_file import load_shipped_model
from bms.presets import load_preset, one_cell_preset_names
from tests.bms.kan_samples import random_network, write_recording

SHORT = TrainingSettings(epochs=6, batch=2000, refinement_steps=20)
FEW = {"training": 6, "validation": 3, "test": 10}
BOX = ((-24.0, 0.0), (0.0, 2.0), (280.0, 320.0), (280.0, 310.0))


def ignore(share):
    pass


def samples_of(network, count=3000, seed=5):
    low, high = np.transpose(BOX)
    inputs = np.random.default_rng(seed).uniform(low, high, (count, 4))
    return Samples(
        inputs, network.evaluate(inputs)[0], np.zeros(count, dtype=np.int64), np.arange(count) * 1.0
    )


@pytest.fixture(scope="module")
def model():
    return model_for_preset(load_preset("lin2014"), SHORT, ignore, FEW)


def test_same_seed_gives_the_same_model_and_another_seed_another(model):
    preset = load_preset("lin2014")

    again = model_for_preset(preset, SHORT, ignore, FEW)
    other = model_for_preset(preset, TrainingSettings(**{**vars(SHORT), "seed": 1}), ignore, FEW)

    assert again == model
    assert model.hash != other.hash


def test_errors_in_the_model_are_those_of_its_network_on_the_splits(model):
    preset = load_preset("lin2014")

    for split in ("training", "validation", "test"):
        kinds = simulated_split(preset, split, SHORT.seed, FEW[split])
        for kind, samples in {**kinds, "overall": joined(kinds.values())}.items():
            error = model.network.evaluate(samples.inputs)[0] - samples.core_temperature_K
            figures = getattr(model.errors[split], kind)
            assert figures.rmse_K == pytest.approx(math.sqrt(np.mean(np.square(error))))
            assert figures.max_abs_error_K == pytest.approx(np.max(np.abs(error)))
            assert figures.bias_K == pytest.approx(np.mean(error), abs=1e-12)
            assert figures.samples == len(error)
    assert model.error_bounds is not None
    assert model.error_bounds.held_out_K == model.errors["test"].overall.max_abs_error_K
    assert model.error_bound_parts_K["estimate"] == model.error_bounds.used_K
    assert model.error_bound_K == pytest.approx(sum(model.error_bound_parts_K.values()))
    assert set(model.error_bound_parts_K) == {"estimate", "search", "sensors", "arithmetic"}


@pytest.mark.parametrize(
    ("width", "grid", "degree"), [((4, 1), 2, 3), ((4, 1, 1), 3, 2), ((4, 2, 2, 1), 2, 3)]
)
def test_any_shape_learns_an_additive_function(width, grid, degree):
    inputs = samples_of(random_network()).inputs
    truth_K = 300.0 + 0.01 * inputs[:, 0] ** 2 + inputs[:, 1] + 0.4 * (inputs[:, 2] - 300.0)
    data = Samples(
        inputs, truth_K, np.zeros(len(inputs), dtype=np.int64), np.arange(len(inputs)) * 1.0
    )
    settings = TrainingSettings(
        width=width, grid=grid, degree=degree, epochs=15, refinement_steps=100
    )
    shares = []

    network = train_network(data, data, BOX, settings, shares.append)

    estimate_K, in_domain = network.evaluate(inputs)
    assert np.sqrt(np.mean((estimate_K - truth_K) ** 2)) < 0.01
    assert in_domain.all()
    assert network.width == width
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_without_refinement_the_penalties_hold_the_edges_small():
    data = samples_of(random_network((4, 2, 1)))

    def size(regularisation):
        settings = TrainingSettings(
            width=(4, 2, 1),
            epochs=10,
            refinement_steps=0,
            regularisation=regularisation,
            l1_penalty=1.0,
        )
        network = train_network(data, data, BOX, settings)
        hidden = [edge.evaluate(np.linspace(-1, 1, 50), 3)[0] for edge in network.layers[0][0]]
        return float(np.mean(np.abs(hidden)))

    assert size(0.1) < 0.5 * size(0.0)


def test_width_that_does_not_fit_the_inputs_is_refused():
    data = samples_of(random_network())
    with pytest.raises(InputError, match="width"):
        train_network(data, data, BOX, TrainingSettings(width=(3, 1)))
    with pytest.raises(InputError, match="end in 1"):
        TrainingSettings(width=(4, 2))


@pytest.mark.parametrize("name", one_cell_preset_names())
def test_measurement_error_bounds_every_reading_within_the_sensors_bounds(name):
    preset = load_preset(name)
    network = load_shipped_model(name).network
    inputs = joined(simulated_split(preset, "evaluation", 0, 5).values()).inputs
    sensors, bus = preset.sensors, BusQuantisation()
    bounds = [
        getattr(sensors, channel).error_bound + getattr(bus, channel)
        for channel in network.input_names
    ]
    rng = np.random.default_rng(0)

    bound_K = measurement_error_K(network, inputs, sensors, bus)

    seen_K = max(
        np.max(np.abs(network.evaluate(inputs + bounds * signs)[0] - network.evaluate(inputs)[0]))
        for signs in rng.choice([-1.0, 1.0], (16, 4))
    )
    # First order, so the curvature of the edges may add a little.
    assert seen_K <= 1.02 * bound_K
    assert bound_K < 0.2


def test_measured_data_are_split_by_time_and_their_box_is_that_of_the_training_part(tmp_path):
    path = write_recording(tmp_path / "run.csv", rows=900)

    model = model_for_measurements(path, SHORT, ignore)

    assert model.preset is None and model.training_hash is None
    assert model.errors["training"].overall.samples == 600
    assert model.errors["test"].overall.samples == 300
    assert model.errors["test"].constant is None
    assert len(model.training.data_sha256) == 64
    low_A = model.network.input_center[0] - model.network.input_half_range[0]
    assert low_A == pytest.approx(-18.0 - 0.05 * 16.0, abs=0.05)
    assert model.network.input_half_range[1] == 0.5
    assert model.errors["test"].overall.rmse_K < 0.05


def test_recording_too_short_to_train_on_is_refused(tmp_path):
    with pytest.raises(InputError, match="99 rows"):
        model_for_measurements(write_recording(tmp_path / "run.csv", rows=99), SHORT, ignore)


def test_figures_of_known_errors():
    figures = error_figures(np.array([301.0, 298.0, 300.0]), np.full(3, 300.0))

    assert figures.rmse_K == pytest.approx(math.sqrt(5.0 / 3.0))
    assert (figures.max_abs_error_K, figures.samples) == (2.0, 3)
    assert figures.bias_K == pytest.approx(-1.0 / 3.0)


def test_one_hidden_node_is_fitted_without_epochs():
    """The additive fit stands in their place; any other width needs them."""
    data = samples_of(random_network())
    for width, is_same in (((4, 1, 1), True), ((4, 2, 1), False)):
        few, more = (replace(SHORT, width=width, epochs=epochs) for epochs in (1, 3))
        networks = [train_network(data, data, BOX, settings) for settings in (few, more)]
        assert (networks[0] == networks[1]) == is_same


def normalised(preset_name, settings, counts=PROFILES_OF_EACH_KIND):
    """Training and validation samples of a preset, and how networks see them."""
    preset = load_preset(preset_name)
    wanted = {split: counts[split] for split in ("training", "validation")}
    kinds = simulated_splits(preset, wanted, settings.seed, settings.lags)
    splits = [joined(kinds[split].values()) for split in wanted]
    scaling = Scaling.of(splits[0], preset.operating_box.ranges(), settings)
    return [scaling.normalised(samples) for samples in splits]


def test_rounds_of_refinement_go_on_as_long_as_they_help():
    """To the end after the paper's epochs, not so after the additive fit."""
    settings = replace(SHORT, epochs=1)
    (x, target), _ = normalised("lin2014", settings, FEW)
    rng = np.random.default_rng(0)

    after_epochs, after_fit = (
        refined(x, target, start, 80, rng)
        for start in (
            penalised_epochs(x, target, settings, rng),
            additive_layers(x, target, settings, 1.0, 1e-9),
        )
    )

    assert len(after_epochs) == 1 + 4
    assert len(after_fit) < 1 + 4
    errors = [mean_square(layers, x, target) for layers in after_fit]
    left = [after / before for before, after in itertools.pairwise(errors)]
    assert all(share <= 0.999 for share in left[:-1])
    assert left[-1] > 0.999


@pytest.mark.long("training")
@pytest.mark.parametrize("preset_name", one_cell_preset_names())
def test_the_papers_epochs_reach_no_smaller_error_than_the_additive_fit(preset_name):
    """Why a network with one hidden node does not take them."""
    settings = TrainingSettings()
    (x, target), held_out = normalised(preset_name, settings)
    rng = np.random.default_rng(settings.seed)
    starts = (
        additive_layers(x, target, settings, 1.0, 1e-9),
        penalised_epochs(x, target, settings, rng),
    )
    additive, paper = (
        min(
            mean_square(layers, *held_out)
            for layers in refined(x, target, start, settings.refinement_steps, rng)
        )
        for start in starts
    )
    assert additive <= paper
