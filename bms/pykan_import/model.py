"""An imported network as a model with errors and error bound of its own."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np

from bms.barrier.margins import BusQuantisation
from bms.data.datasets import simulated_split
from bms.data.measurements import read_measurements
from bms.data.profiles import draw_profiles
from bms.data.simulate import Samples, joined, simulate
from bms.kan.accuracy import ARITHMETIC_K, error_figures, measurement_error_K
from bms.kan.model_file import (
    FORMAT_VERSION,
    ErrorFigures,
    KanModel,
    SplitErrors,
    TrainingRecord,
)
from bms.kan.network import INPUT_NAMES, Network
from bms.kan.settings import TrainingSettings
from bms.presets import Preset
from bms.pykan_import.checkpoint import Checkpoint

UNKNOWN_ERROR_K = 1000.0
"""Bound of a network that is no estimator of the four inputs: too wide for any current."""

_SEED = 0
_STEP_PROFILES = 60
_STEPS_STREAM = 4


def imported_model(
    checkpoint: Checkpoint, network: Network, preset: Preset, data: Path | None
) -> KanModel:
    """Model of an imported network, with its errors on the preset's test profiles or on a CSV file.

    The error bound is made up as for networks that are trained here. A network of other inputs than
    the four gets no errors, and a bound that lets no current through.
    """
    errors: dict[str, SplitErrors] = {}
    parts_K = {"unknown": UNKNOWN_ERROR_K}
    source, profiles, paired = "not evaluated", 0, False
    if network.input_names == INPUT_NAMES and data is not None:
        figures = _figures(network, read_measurements(data).samples())
        errors, parts_K = {"test": SplitErrors(figures)}, _parts_K(figures, {})
        digest = hashlib.sha256(data.read_bytes()).hexdigest()
        source, profiles = f"tested on {data.name}, SHA-256 {digest}", 1
    elif network.input_names == INPUT_NAMES:
        kinds = simulated_split(preset, "test", _SEED)
        samples = joined(kinds.values())
        figures = _figures(network, samples)
        errors["test"] = SplitErrors(
            figures, _figures(network, kinds["constant"]), _figures(network, kinds["dynamic"])
        )
        rng = np.random.default_rng([_SEED, _STEPS_STREAM])
        steps = simulate(preset, draw_profiles(preset, "steps", _STEP_PROFILES, rng), rng)
        worst_step_K = _figures(network, steps).max_abs_error_K
        parts_K = _parts_K(
            figures,
            {
                "full_steps_beyond": max(0.0, worst_step_K - figures.max_abs_error_K),
                "sensors": measurement_error_K(
                    network, samples.inputs, preset.sensors, BusQuantisation()
                ),
            },
        )
        source, paired = f"tested on preset {preset.name}", True
        profiles = 1 + int(samples.profile.max())
    return KanModel(
        FORMAT_VERSION,
        network,
        preset.name if paired else None,
        preset.training_hash if paired else None,
        TrainingRecord(
            _settings(checkpoint, network),
            f"imported from pykan checkpoint {checkpoint.name}, {source}",
            checkpoint.state_sha256,
            {"test": profiles},
        ),
        errors,
        math.fsum(parts_K.values()),
        parts_K,
    )


def _parts_K(figures: ErrorFigures, further_K: dict[str, float]) -> dict[str, float]:
    return {
        "held_out_profiles": figures.max_abs_error_K,
        **further_K,
        "arithmetic": ARITHMETIC_K,
    }


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
