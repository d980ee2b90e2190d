"""Training: an additive fit or the paper's penalised epochs, then steps without penalties."""

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
_LEAST_GAIN = 1e-3
"""Share of the mean square that a round of steps has to take away for another one to follow."""
_NO_PENALTY = Penalty(0.0, 0.0, 0.0)


def train_network(
    training: Samples,
    validation: Samples,
    ranges: Ranges,
    settings: TrainingSettings,
    progress: Progress = to_nobody,
) -> Network:
    """Network fitted to samples whose inputs lie within `ranges`, (low, high) for each input.

    It starts from the additive fit where there is one hidden node, else from the paper's penalised
    epochs, and is refined on all samples without penalties, which would leave a bias of some
    hundredths of a kelvin. Of all the networks on the way the one with the smallest validation
    error is kept. `progress` gets the share done, 0..1. Raises InputError when the width does not
    fit the inputs.
    """
    scaling = Scaling.of(training, ranges, settings)
    x, target = scaling.normalised(training)
    held_out = scaling.normalised(validation)
    rng = np.random.default_rng(settings.seed)
    if settings.has_one_hidden_node:
        start, share = additive_layers(x, target, settings, 1.0, _START_ROUGHNESS), 0.1
    else:
        start, share = penalised_epochs(x, target, settings, rng, part(progress, 0.0, 0.6)), 0.6
    candidates = refined(
        x, target, start, settings.refinement_steps, rng, part(progress, share, 1.0)
    )
    best = min(candidates, key=lambda layers: mean_square(layers, *held_out))
    return scaling.network(best, settings, 1.0, domain_of(x.T))


def penalised_epochs(
    x: Array,
    target: Array,
    settings: TrainingSettings,
    rng: np.random.Generator,
    progress: Progress = to_nobody,
) -> list[TrainableLayer]:
    """The paper's training on normalised samples x (in, N): L-BFGS steps on a batch an epoch.

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


def refined(
    x: Array,
    target: Array,
    start: list[TrainableLayer],
    steps: int,
    rng: np.random.Generator,
    progress: Progress = to_nobody,
) -> list[list[TrainableLayer]]:
    """Networks after no and each further round of steps on all samples without penalties.

    Samples are normalised, x (in, N). The rounds end early where one brings nothing.
    """
    candidates = [solve_last_layer(follow_data(start, x), x, target)]
    left = mean_square(candidates[0], x, target)
    rounds = -(-steps // _STEPS_PER_ROUND)
    for number in range(rounds):
        progress(number / rounds)
        layers = candidates[-1]
        probes = x[:, rng.permutation(len(target))[:_PROBES]]
        loss = Loss(layers, x, target, _NO_PENALTY)
        layers = descend(layers, loss, _STEPS_PER_ROUND, gauss_newton_directions(layers, probes))
        candidates.append(solve_last_layer(follow_data(layers, x), x, target))
        before, left = left, mean_square(candidates[-1], x, target)
        if left > (1.0 - _LEAST_GAIN) * before:
            break
    progress(1.0)
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
