"""An imported network as a model with errors and error bounds of its own."""

from __future__ import annotations

import hashlib
from pathlib import Path

from bms.bounds.derive import bounds_for_preset, bounds_for_recording, error_bound_parts_K
from bms.bounds.record import ErrorBounds
from bms.data.datasets import simulated_split
from bms.data.measurements import read_measurements
from bms.data.simulate import Samples, joined
from bms.kan.accuracy import ErrorFigures, error_figures
from bms.kan.network import INPUT_NAMES, Network
from bms.kan.settings import TrainingSettings
from bms.model.make import finished_model
from bms.model.model_file import KanModel, SplitErrors, TrainingRecord
from bms.presets import Preset
from bms.progress import Progress, to_nobody
from bms.pykan_import.checkpoint import Checkpoint

UNKNOWN_ERROR_K = 1000.0
"""Bound of a network that is no estimator of the four inputs: too wide for any current."""

_SEED = 0


def imported_model(
    checkpoint: Checkpoint,
    network: Network,
    preset: Preset,
    data: Path | None,
    progress: Progress = to_nobody,
) -> KanModel:
    """Model of an imported network, with its errors on the preset's test profiles or on a CSV file.

    The error bound is derived as for networks that are trained here. A network of other inputs than
    the four gets no errors, and a bound that lets no current through.
    """
    if network.input_names != INPUT_NAMES:
        return _model(checkpoint, network, "not evaluated", {}, {"unknown": UNKNOWN_ERROR_K})
    if data is not None:
        recording = read_measurements(data).samples()
        digest = hashlib.sha256(data.read_bytes()).hexdigest()
        bounds = bounds_for_recording(network, recording, recording, _SEED, progress=progress)
        return _model(
            checkpoint,
            network,
            f"tested on {data.name}, SHA-256 {digest}",
            {"test": SplitErrors(_figures(network, recording))},
            error_bound_parts_K(network, bounds, recording, None),
            bounds,
        )
    kinds = simulated_split(preset, "test", _SEED)
    test = joined(kinds.values())
    training = joined(simulated_split(preset, "training", _SEED).values())
    bounds = bounds_for_preset(network, preset, training, test, _SEED, progress=progress)
    return _model(
        checkpoint,
        network,
        f"tested on preset {preset.name}",
        {
            "test": SplitErrors(
                _figures(network, test),
                _figures(network, kinds["constant"]),
                _figures(network, kinds["dynamic"]),
            )
        },
        error_bound_parts_K(network, bounds, test, preset),
        bounds,
        preset,
    )


def _model(
    checkpoint: Checkpoint,
    network: Network,
    tested: str,
    errors: dict[str, SplitErrors],
    parts_K: dict[str, float],
    bounds: ErrorBounds | None = None,
    preset: Preset | None = None,
) -> KanModel:
    record = TrainingRecord(
        _settings(checkpoint, network),
        f"imported from pykan checkpoint {checkpoint.name}, {tested}",
        checkpoint.state_sha256,
        {},
    )
    return finished_model(network, record, errors, parts_K, bounds, preset)


def _figures(network: Network, samples: Samples) -> ErrorFigures:
    return error_figures(network.evaluate(samples.inputs)[0], samples.core_temperature_K)


def _settings(checkpoint: Checkpoint, network: Network) -> TrainingSettings:
    """The shape; nothing was trained here."""
    return TrainingSettings(
        width=network.width,
        grid=checkpoint.layers[0].knots.shape[1] - 1 - 2 * checkpoint.degree,
        degree=checkpoint.degree,
        epochs=0,
        grid_update_stop=0,
        regularisation=0.0,
        l1_penalty=0.0,
        entropy_penalty=0.0,
        refinement_steps=0,
        seed=_SEED,
    )
