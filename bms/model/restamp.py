"""Gives models the training hash of their preset anew, after the way of hashing has changed.

    python -m bms.model.restamp MODEL.json...

Nothing is trained: network, errors and bounds stay as they are. A model is written only when its
errors on the test profiles and its bound come out of the preset again as they are recorded.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np

from bms.bounds.derive import FULL_EFFORT, error_bound_parts_K
from bms.bounds.worst_case import worst_case
from bms.data.datasets import PROFILES_OF_EACH_KIND, simulated_split
from bms.data.profiles import KINDS
from bms.data.simulate import joined
from bms.errors import BmsError, InputError, ModelMismatchError
from bms.kan.accuracy import error_figures
from bms.model.model_file import KanModel, load_model, save_model, train_command
from bms.presets import Preset, load_preset

_TOLERANCE = 1e-6
"""Relative, for the arithmetic of another machine."""


def restamped(model: KanModel, preset: Preset) -> KanModel:
    """The model with the preset's training hash.

    Raises InputError for a model that was not trained on data of a preset, and ModelMismatchError
    when the preset gives other errors or another bound than the model has recorded.
    """
    recorded = model.error_bounds
    if model.training_hash is None or recorded is None or recorded.worst_case is None:
        raise InputError("trained on measurements, so there is no training hash; leave it as it is")
    settings = model.training.settings
    profiles = model.training.profiles["test"] // len(KINDS)
    kinds = simulated_split(preset, "test", settings.seed, profiles, settings.lags)
    samples = joined(kinds.values())
    figures = error_figures(model.network.evaluate(samples.inputs)[0], samples.core_temperature_K)
    effort = FULL_EFFORT.scaled(profiles / PROFILES_OF_EACH_KIND["test"])
    searched = worst_case(model.network, preset, settings.seed, effort)
    parts_K = error_bound_parts_K(model.network, recorded, samples, preset)
    for name, now, then in (
        ("error on test profiles", astuple(figures), astuple(model.errors["test"].overall)),
        ("error that a search finds", searched.value_K, recorded.worst_case.value_K),
        ("error bound", list(parts_K.values()), list(model.error_bound_parts_K.values())),
    ):
        if not np.allclose(now, then, rtol=_TOLERANCE, atol=0.0):
            raise ModelMismatchError(
                f"{name}: preset '{preset.name}' gives another one than is recorded, so the model "
                f"is not for this preset; train it again with {train_command(preset.name)}"
            )
    return replace(model, training_hash=preset.training_hash)


def main() -> None:
    """Restamp the models that the command line names; what is unusable is one line and status 2."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("models", type=Path, nargs="+")
    for path in parser.parse_args().models:
        try:
            model = load_model(path)
            save_model(restamped(model, load_preset(model.preset or "")), path)
        except BmsError as error:
            message = str(error)
            print(message if str(path) in message else f"{path}: {message}", file=sys.stderr)
            sys.exit(2)


if __name__ == "__main__":
    main()
