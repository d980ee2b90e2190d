"""Making of a model from data: training, errors on every split, error bound."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bms.arrays import Array
from bms.bounds.derive import (
    FULL_EFFORT,
    bounds_for_preset,
    bounds_for_recording,
    error_bound_parts_K,
)
from bms.bounds.record import ErrorBounds
from bms.data.datasets import PROFILES_OF_EACH_KIND, Split, simulated_splits, split_by_time
from bms.data.measurements import read_measurements, recording_sha256
from bms.data.simulate import Samples, joined
from bms.errors import InputError
from bms.kan.accuracy import ErrorFigures, error_figures
from bms.kan.measured import train_on_recording
from bms.kan.network import Network
from bms.kan.scaling import Ranges
from bms.kan.settings import TrainingSettings
from bms.kan.training import train_network
from bms.model.model_file import FORMAT_VERSION, KanModel, SplitErrors, TrainingRecord
from bms.presets import Preset
from bms.progress import Progress, part
from bms.tables.rounding import edge_error_bounds, fits_firmware

_SHARE_OF_TRAINING = 0.8
"""Of the time; the error bounds take the rest."""
_BOX_MARGIN = 0.1
_SMALLEST_HALF_RANGE = 0.5
_FEWEST_ROWS = 100


def model_for_preset(
    preset: Preset,
    settings: TrainingSettings,
    progress: Progress,
    counts: Mapping[Split, int] = PROFILES_OF_EACH_KIND,
) -> KanModel:
    """Model trained on profiles simulated from the preset.

    `counts` are profiles of each kind; `progress` gets the share of the training that is done.
    Raises InputError when the width does not fit the inputs, or the profiles are too few.
    """
    splits: tuple[Split, ...] = ("training", "validation", "test")
    wanted = {split: counts[split] for split in splits}
    data = simulated_splits(preset, wanted, settings.seed, settings.lags)
    samples = {split: joined(kinds.values()) for split, kinds in data.items()}
    network = network_for_preset(
        preset,
        samples["training"],
        samples["validation"],
        settings,
        part(progress, 0.0, _SHARE_OF_TRAINING),
    )
    errors: dict[str, SplitErrors] = {
        split: SplitErrors(
            overall=_figures(network, samples[split]),
            constant=_figures(network, kinds["constant"]),
            dynamic=_figures(network, kinds["dynamic"]),
        )
        for split, kinds in data.items()
    }
    bounds = bounds_for_preset(
        network,
        preset,
        samples["training"],
        samples["test"],
        settings.seed,
        FULL_EFFORT.scaled(counts["test"] / PROFILES_OF_EACH_KIND["test"]),
        progress=part(progress, _SHARE_OF_TRAINING, 1.0),
    )
    return finished_model(
        network,
        TrainingRecord(
            settings,
            f"simulated from preset {preset.name}",
            None,
            {split: 2 * counts[split] for split in splits},
        ),
        errors,
        error_bound_parts_K(network, bounds, samples["test"], preset),
        bounds,
        preset,
    )


def network_for_preset(
    preset: Preset,
    training: Samples,
    validation: Samples,
    settings: TrainingSettings,
    progress: Progress,
) -> Network:
    """Network for the preset's operating box; lagged inputs get a tenth more than they span.

    Raises InputError when the width does not fit the inputs.
    """
    box = preset.operating_box.ranges()
    ranges = (*box, *_box(training.inputs[:, len(box) :]))
    return train_network(training, validation, ranges, settings, progress)


def model_for_measurements(path: Path, settings: TrainingSettings, progress: Progress) -> KanModel:
    """Model trained on the first two thirds of a recording and tested on the last third.

    The box spans the first two thirds and a tenth of their half range on either side. The error
    bound covers all of it; the noise of the sensors is part of it already.
    Raises InputError when the file cannot be used or is too short.
    """
    recording = read_measurements(path).samples(settings.lags)
    rows = len(recording.core_temperature_K)
    if rows < _FEWEST_ROWS:
        raise InputError(f"{path}: {rows} rows; training needs at least {_FEWEST_ROWS}")
    training, test = split_by_time(recording)
    of_training = part(progress, 0.0, _SHARE_OF_TRAINING)
    network = train_on_recording(training, _box(training.inputs), settings, of_training)
    of_bounds = part(progress, _SHARE_OF_TRAINING, 1.0)
    bounds = bounds_for_recording(network, training, test, settings.seed, progress=of_bounds)
    return finished_model(
        network,
        TrainingRecord(
            settings,
            path.name,
            recording_sha256(path),
            {"training": 1, "test": 1},
        ),
        {
            "training": SplitErrors(_figures(network, training)),
            "test": SplitErrors(_figures(network, test)),
        },
        error_bound_parts_K(network, bounds, test, None),
        bounds,
        None,
    )


def finished_model(
    network: Network,
    record: TrainingRecord,
    errors: dict[str, SplitErrors],
    parts_K: dict[str, float],
    bounds: ErrorBounds | None,
    preset: Preset | None,
) -> KanModel:
    """The model of a network: e_max is the sum of `parts_K`; the bounds of its tables are added.

    Without a preset it was trained on measurements.
    """
    return KanModel(
        FORMAT_VERSION,
        network,
        None if preset is None else preset.name,
        None if preset is None else preset.training_hash,
        record,
        errors,
        math.fsum(parts_K.values()),
        parts_K,
        bounds,
        edge_error_bounds(network) if fits_firmware(network) else (),
    )


def _figures(network: Network, samples: Samples) -> ErrorFigures:
    return error_figures(network.evaluate(samples.inputs)[0], samples.core_temperature_K)


def _box(inputs: Array) -> Ranges:
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    # A channel that does not vary, such as no cooling, still needs a range around its value.
    half = np.maximum((0.5 + _BOX_MARGIN / 2) * (high - low), _SMALLEST_HALF_RANGE)
    center = 0.5 * (low + high)
    return tuple(zip((center - half).tolist(), (center + half).tolist()))
