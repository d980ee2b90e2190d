"""Training: the paper's penalised epochs or an additive fit, then steps without penalties."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.data.simulate import Samples
from bms.kan.additive import additive_layers
from bms.kan.basis import uniform_knots
from bms.kan.descent import descend, gauss_newton_directions
from bms.kan.domain import domain_of
from bms.kan.grid import follow_data, solve_last_layer
from bms.kan.loss import Loss, Penalty
from bms.kan.network import Network
from bms.kan.scaling import Ranges, Scaling
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import TrainableLayer, forward
from bms.progress import Progress, part, to_nobody

_STEPS_PER_EPOCH = 20
_EPOCHS_PER_GRID_UPDATE = 5
_STEPS_PER_ROUND = 20
_PROBES = 2**14
_INITIAL_NOISE = 0.1
_START_ROUGHNESS = 1e-9
_NO_PENALTY = Penalty(0.0, 0.0, 0.0)


def train_network(
    training: Samples,
    validation: Samples,
    ranges: Ranges,
    settings: TrainingSettings,
    progress: Progress = to_nobody,
) -> Network:
    """Network fitted to samples whose inputs lie within `ranges`, (low, high) for each input.

    Two starts: the paper's penalised epochs and, with one hidden node, the additive fit. Each is
    refined on all samples without penalties, which would leave a bias of some hundredths of a
    kelvin. Of all the networks on the way the one with the smallest validation error is kept.
    `progress` gets the share done, 0..1. Raises InputError when the width does not fit the inputs.
    """
    scaling = Scaling.of(training, ranges, settings)
    x, target = scaling.normalised(training)
    held_out = scaling.normalised(validation)
    rng = np.random.default_rng(settings.seed)
    starts = [_penalised_epochs(x, target, settings, rng, part(progress, 0.0, 0.6))]
    if settings.has_one_hidden_node:
        starts.append(additive_layers(x, target, settings, 1.0, _START_ROUGHNESS))
    candidates = []
    for number, start in enumerate(starts):
        candidates += _refined(x, target, start, settings.refinement_steps, rng)
        progress(0.6 + 0.4 * (number + 1) / len(starts))
    best = min(candidates, key=lambda layers: mean_square(layers, *held_out))
    return scaling.network(best, settings, 1.0, domain_of(x.T))


def _penalised_epochs(
    x: Array,
    target: Array,
    settings: TrainingSettings,
    rng: np.random.Generator,
    progress: Progress,
) -> list[TrainableLayer]:
    """The paper's training: each epoch takes a few L-BFGS steps on a new batch.

    Until the epoch of `grid_update_stop` the grids follow the data.
    """
    penalty = Penalty(settings.regularisation, settings.l1_penalty, settings.entropy_penalty)
    layers = follow_data(initial_layers(settings, rng), x)
    for epoch in range(settings.epochs):
        if 0 < epoch <= settings.grid_update_stop and epoch % _EPOCHS_PER_GRID_UPDATE == 0:
            layers = follow_data(layers, x)
        batch = rng.permutation(len(target))[: settings.batch]
        layers = descend(
            layers, Loss(layers, x[:, batch], target[batch], penalty), _STEPS_PER_EPOCH
        )
        progress((epoch + 1) / settings.epochs)
    return layers


def _refined(
    x: Array, target: Array, start: list[TrainableLayer], steps: int, rng: np.random.Generator
) -> list[list[TrainableLayer]]:
    """Networks after no and each further round of steps on all samples without penalties."""
    candidates = [solve_last_layer(follow_data(start, x), x, target)]
    for _ in range(-(-steps // _STEPS_PER_ROUND)):
        layers = candidates[-1]
        probes = x[:, rng.permutation(len(target))[:_PROBES]]
        loss = Loss(layers, x, target, _NO_PENALTY)
        layers = descend(layers, loss, _STEPS_PER_ROUND, gauss_newton_directions(layers, probes))
        candidates.append(solve_last_layer(follow_data(layers, x), x, target))
    return candidates


def mean_square(layers: list[TrainableLayer], x: Array, target: Array) -> float:
    """Mean squared error of normalised samples x (in, N) against target (N,)."""
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
