"""Training on one recording: few data, no second recording to choose by, sensors that drift.

How straight the functions must be is chosen by leaving out one stretch of the recording after the
other. A neighbour of a sample says nothing new, so the stretches are long; the middle one of their
errors counts, because one stretch alone may hold the coldest hour.
"""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.data.simulate import Samples
from bms.kan.additive import additive_layers
from bms.kan.domain import domain_of
from bms.kan.network import Network
from bms.kan.scaling import Ranges, Scaling
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import TrainableLayer
from bms.kan.training import mean_square, train_network
from bms.progress import Progress, to_nobody

REACH = 1.5
"""Straight functions may go on beyond the trained box; what they give there is flagged."""

_STRETCHES = 8
_ROUGHNESS = tuple(10.0 ** np.arange(-6.0, 2.0, 0.5))
_TOLERATED = 1.05
_SHARE_FITTED = 0.75


def train_on_recording(
    training: Samples,
    ranges: Ranges,
    settings: TrainingSettings,
    progress: Progress = to_nobody,
) -> Network:
    """Network fitted to one recording whose inputs lie within `ranges`.

    With one hidden node it is the smoothest additive fit whose error is within 5 % of the best;
    other widths are trained as on simulated data, the last quarter being held out to choose by.
    Raises InputError when the width does not fit.
    """
    if not settings.has_one_hidden_node:
        cut = round(_SHARE_FITTED * training.core_temperature_K.size)
        fitted, held_out = training.rows(slice(cut)), training.rows(slice(cut, None))
        return train_network(fitted, held_out, ranges, settings, progress)
    scaling = Scaling.of(training, ranges, settings)
    x, target = scaling.normalised(training)
    errors = []
    for number, roughness in enumerate(_ROUGHNESS):
        errors.append(_left_out_error(x, target, settings, roughness))
        progress((number + 1) / len(_ROUGHNESS))
    smoothest = max(
        roughness
        for roughness, error in zip(_ROUGHNESS, errors)
        if error <= _TOLERATED * min(errors)
    )
    layers = additive_layers(x, target, settings, REACH, smoothest)
    return scaling.network(layers, settings, REACH, domain_of(x.T))


def _left_out_error(x: Array, target: Array, settings: TrainingSettings, roughness: float) -> float:
    """Median over the stretches of the error on a stretch that the fit has not seen."""
    errors = []
    for stretch in np.array_split(np.arange(target.size), _STRETCHES):
        rest = np.ones(target.size, dtype=np.bool_)
        rest[stretch] = False
        layers: list[TrainableLayer] = additive_layers(
            x[:, rest], target[rest], settings, REACH, roughness
        )
        errors.append(np.sqrt(mean_square(layers, x[:, stretch], target[stretch])))
    return float(np.median(errors))
