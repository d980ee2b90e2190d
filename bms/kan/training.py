"""Training: the paper's penalised epochs, then a refinement without penalties."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bms.data.simulate import Samples
from bms.errors import InputError
from bms.kan.basis import Array, uniform_knots
from bms.kan.descent import descend, gauss_newton_directions
from bms.kan.grid import follow_data, solve_last_layer
from bms.kan.loss import Loss, Penalty
from bms.kan.network import INPUT_NAMES, Network
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import TrainableLayer, forward

Ranges = tuple[tuple[float, float], ...]

_STEPS_PER_EPOCH = 20
_EPOCHS_PER_GRID_UPDATE = 5
_STEPS_PER_ROUND = 20
_PROBES = 2**14
_INITIAL_NOISE = 0.1
_NO_PENALTY = Penalty(0.0, 0.0, 0.0)


def train_network(
    training: Samples,
    validation: Samples,
    ranges: Ranges,
    settings: TrainingSettings,
    progress: Callable[[float], None] = lambda share: None,
) -> Network:
    """Network fitted to samples whose inputs lie within `ranges`, (low, high) for each input.

    Each epoch takes a few L-BFGS steps on a new batch; until the epoch of `grid_update_stop` the
    grids follow the data. The refinement takes all samples and no penalties, which would leave a
    bias of some hundredths of a kelvin. Of the network after the epochs and after each round of
    the refinement, the one with the smallest validation error is kept. `progress` gets the share
    done, 0..1. Raises InputError when the width does not fit the inputs.
    """
    if settings.width[0] != len(ranges):
        raise InputError(f"width: must begin with {len(ranges)}, the number of inputs")
    low, high = np.transpose(np.asarray(ranges))
    center, half_range = 0.5 * (low + high), 0.5 * (high - low)
    coldest_K = float(training.core_temperature_K.min())
    warmest_K = float(training.core_temperature_K.max())
    output_center_K = 0.5 * (warmest_K + coldest_K)
    # A recording at one temperature still needs a scale.
    output_half_range_K = max(0.5 * (warmest_K - coldest_K), 1e-3)

    def normalised(samples: Samples) -> tuple[Array, Array]:
        x = np.ascontiguousarray(((samples.inputs - center) / half_range).T)
        return x, (samples.core_temperature_K - output_center_K) / output_half_range_K

    layers = _fitted_layers(normalised(training), normalised(validation), settings, progress)
    return Network(
        settings.degree,
        INPUT_NAMES,
        tuple(center.tolist()),
        tuple(half_range.tolist()),
        output_center_K,
        output_half_range_K,
        tuple(layer.frozen() for layer in layers),
    )


def _fitted_layers(
    training: tuple[Array, Array],
    validation: tuple[Array, Array],
    settings: TrainingSettings,
    progress: Callable[[float], None],
) -> list[TrainableLayer]:
    x, target = training
    rng = np.random.default_rng(settings.seed)
    penalty = Penalty(settings.regularisation, settings.l1_penalty, settings.entropy_penalty)
    rounds = -(-settings.refinement_steps // _STEPS_PER_ROUND)
    # A round on all samples takes about as long as five epochs.
    total = max(settings.epochs + 5 * rounds, 1)

    layers = follow_data(initial_layers(settings, rng), x)
    for epoch in range(settings.epochs):
        if 0 < epoch <= settings.grid_update_stop and epoch % _EPOCHS_PER_GRID_UPDATE == 0:
            layers = follow_data(layers, x)
        batch = rng.permutation(len(target))[: settings.batch]
        layers = descend(
            layers, Loss(layers, x[:, batch], target[batch], penalty), _STEPS_PER_EPOCH
        )
        progress((epoch + 1) / total)

    candidates = [solve_last_layer(follow_data(layers, x), x, target)]
    for number in range(rounds):
        layers = candidates[-1]
        probes = x[:, rng.permutation(len(target))[:_PROBES]]
        loss = Loss(layers, x, target, _NO_PENALTY)
        layers = descend(layers, loss, _STEPS_PER_ROUND, gauss_newton_directions(layers, probes))
        candidates.append(solve_last_layer(follow_data(layers, x), x, target))
        progress((settings.epochs + 5 * (number + 1)) / total)
    return min(candidates, key=lambda layers: _mean_square(layers, *validation))


def _mean_square(layers: list[TrainableLayer], x: Array, target: Array) -> float:
    return float(np.mean((forward(layers, x)[0] - target) ** 2))


def initial_layers(settings: TrainingSettings, rng: np.random.Generator) -> list[TrainableLayer]:
    """Random layers on uniform grids from -1 to 1: base weights up to 1/sqrt(in), small splines."""
    layers = []
    for inputs, outputs in zip(settings.width, settings.width[1:]):
        shape = (outputs, inputs)
        knots = uniform_knots(-1.0, 1.0, settings.grid, settings.degree)
        count = settings.grid + settings.degree
        layers.append(
            TrainableLayer(
                settings.degree,
                np.tile(knots, (inputs, 1)),
                rng.uniform(-1.0, 1.0, shape) / np.sqrt(inputs),
                np.ones(shape),
                _INITIAL_NOISE * rng.standard_normal((*shape, count)),
            )
        )
    return layers
