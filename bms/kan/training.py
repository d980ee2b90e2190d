"""Training: the paper's penalised epochs, then a refinement without penalties."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bms.errors import InputError
from bms.kan.basis import Array, uniform_knots
from bms.kan.descent import descend, gauss_newton_directions
from bms.kan.grid import follow_data, solve_last_layer
from bms.kan.loss import Loss, Penalty
from bms.kan.network import INPUT_NAMES, Network
from bms.kan.settings import TrainingSettings
from bms.kan.trainable import TrainableLayer, forward

_STEPS_PER_EPOCH = 20
_EPOCHS_PER_GRID_UPDATE = 5
_STEPS_PER_ROUND = 20
_PROBES = 2**14
_INITIAL_NOISE = 0.1
_NO_PENALTY = Penalty(0.0, 0.0, 0.0)


def train_network(
    inputs: Array,
    core_temperature_K: Array,
    ranges: tuple[tuple[float, float], ...],
    settings: TrainingSettings,
    progress: Callable[[float], None] = lambda share: None,
) -> Network:
    """Network fitted to samples: inputs (N, n_in) within `ranges`, core temperature (N,) in K.

    Each epoch takes a few L-BFGS steps on a new batch; until the epoch of `grid_update_stop` the
    grids follow the data. The refinement takes all samples and no penalties, which would leave a
    bias of some hundredths of a kelvin. The best of `starts` is kept. `progress` gets the share
    done, 0..1. Raises InputError when the width does not fit the inputs.
    """
    if settings.width[0] != len(ranges):
        raise InputError(f"width: must begin with {len(ranges)}, the number of inputs")
    low, high = np.transpose(np.asarray(ranges))
    center, half_range = 0.5 * (low + high), 0.5 * (high - low)
    top_K, bottom_K = float(core_temperature_K.max()), float(core_temperature_K.min())
    output_center_K, output_half_range_K = 0.5 * (top_K + bottom_K), 0.5 * (top_K - bottom_K)
    x = np.ascontiguousarray(((inputs - center) / half_range).T)
    target = (core_temperature_K - output_center_K) / output_half_range_K

    best: tuple[float, list[TrainableLayer]] | None = None
    for start in range(settings.starts):
        rng = np.random.default_rng([settings.seed, start])
        layers = _one_start(
            x, target, settings, rng, lambda s: progress((start + s) / settings.starts)
        )
        mse = float(np.mean((forward(layers, x)[0] - target) ** 2))
        if best is None or mse < best[0]:
            best = mse, layers
    assert best is not None
    return Network(
        settings.degree,
        INPUT_NAMES,
        tuple(center.tolist()),
        tuple(half_range.tolist()),
        output_center_K,
        output_half_range_K,
        tuple(layer.frozen() for layer in best[1]),
    )


def _one_start(
    x: Array,
    target: Array,
    settings: TrainingSettings,
    rng: np.random.Generator,
    progress: Callable[[float], None],
) -> list[TrainableLayer]:
    penalty = Penalty(settings.regularisation, settings.l1_penalty, settings.entropy_penalty)
    layers = follow_data(initial_layers(settings, rng), x)
    rounds = -(-settings.refinement_steps // _STEPS_PER_ROUND)
    total = max(settings.epochs + 2 * rounds, 1)
    for epoch in range(settings.epochs):
        if 0 < epoch <= settings.grid_update_stop and epoch % _EPOCHS_PER_GRID_UPDATE == 0:
            layers = follow_data(layers, x)
        batch = rng.permutation(len(target))[: settings.batch]
        layers = descend(layers, Loss(layers, x[:, batch], target[batch], penalty), _STEPS_PER_EPOCH)
        progress((epoch + 1) / total)
    layers = solve_last_layer(follow_data(layers, x), x, target)
    for number in range(rounds):
        directions = gauss_newton_directions(layers, x[:, rng.permutation(len(target))[:_PROBES]])
        loss = Loss(layers, x, target, _NO_PENALTY)
        layers = descend(layers, loss, _STEPS_PER_ROUND, directions)
        layers = solve_last_layer(follow_data(layers, x), x, target)
        progress((settings.epochs + 2 * (number + 1)) / total)
    return layers


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
