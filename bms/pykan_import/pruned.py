"""Networks of which pykan's prune_input left some inputs only."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from bms.errors import InputError
from bms.kan.network import INPUT_NAMES
from bms.pykan_import.checkpoint import Checkpoint, CheckpointLayer

ALL_INPUTS = tuple(range(len(INPUT_NAMES)))


def with_all_inputs(checkpoint: Checkpoint, input_id: Sequence[int] | None) -> Checkpoint:
    """The network with every input of the cell, those that were pruned on edges of zero.

    `input_id` is pykan's: of the four inputs (current, cooling power, surface, coolant) the ones
    that are left, in the network's order. Without it nothing changes; InputError when the network
    was pruned, since then the columns are not known, and for numbers that do not fit.
    """
    left = len(checkpoint.layers[0].knots)
    if input_id is None:
        if checkpoint.has_pruned_inputs:
            example = ",".join(map(str, ALL_INPUTS[: max(1, min(left, len(ALL_INPUTS)))]))
            raise InputError(
                f"{checkpoint.name}: prune_input has left {left} inputs, and pykan's files do not "
                f"say which; give its input_id, such as --input-id {example}"
            )
        return checkpoint
    told = ",".join(map(str, input_id))
    if len(input_id) != left:
        raise InputError(f"--input-id {told}: the network has {left} inputs; give as many numbers")
    if len(set(input_id)) != left or not set(input_id) <= set(ALL_INPUTS):
        raise InputError(
            f"--input-id {told}: the inputs are 0 current, 1 cooling power, 2 surface and 3 "
            "coolant temperature; give each at most once, or train on these"
        )
    samples = checkpoint.samples
    if samples is not None:
        samples = np.zeros((len(samples), len(ALL_INPUTS)))
        samples[:, list(input_id)] = checkpoint.samples
    first = _placed(checkpoint.layers[0], input_id)
    return dataclasses.replace(checkpoint, layers=(first, *checkpoint.layers[1:]), samples=samples)


def _placed(layer: CheckpointLayer, input_id: Sequence[int]) -> CheckpointLayer:
    """The layer with its edges at the places of their inputs, and zero elsewhere."""
    inputs, places = len(ALL_INPUTS), list(input_id)
    _, outputs, splines = layer.coefficients.shape
    # Evenly spaced over -1..1 within, as pykan begins.
    degree = layer.knots.shape[1] - 1 - splines
    step = 2.0 / (splines - degree)
    knots = np.tile(-1.0 + step * (np.arange(layer.knots.shape[1]) - degree), (inputs, 1))
    coefficients = np.zeros((inputs, outputs, splines))
    base_scale, spline_scale = np.zeros((inputs, outputs)), np.zeros((inputs, outputs))
    knots[places] = layer.knots
    coefficients[places] = layer.coefficients
    base_scale[places], spline_scale[places] = layer.base_scale, layer.spline_scale
    return CheckpointLayer(
        knots, coefficients, base_scale, spline_scale, layer.node_scale, layer.node_shift
    )
