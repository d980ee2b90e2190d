"""A checkpoint of pykan as a network of this project.

Both have the same edges, w_b silu(x) + w_s sum_i c_i B_i(x), on knots that belong to the input.
Scale and shift of a node go into its edges exactly: B-splines sum to 1 within the grid, so a
constant added to all coefficients of an edge adds it to the edge.
"""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.errors import InputError
from bms.kan.network import INPUT_NAMES, Edge, Layer, Network
from bms.kan.scaling import Scaling
from bms.pykan_import.checkpoint import Checkpoint, CheckpointLayer
from bms.tables.rounding import fits_firmware

_WIDEST_GRID = 1.1
_FLOAT32_ROUNDING = 1e-6


def imported_network(checkpoint: Checkpoint, scaling: Scaling) -> Network:
    """Network with the values of pykan's wherever its inputs and nodes stay within their grids.

    Beyond a grid pykan's spline falls to 0; ours keeps the last value and flags the estimate. Where
    the samples that pykan saw last go beyond a grid, the grid is widened by pykan's own extension,
    as far as the firmware has room for that. Raises InputError for inputs that were not scaled to
    -1..1, a wrong number of scales, and more than one output.
    """
    first = checkpoint.layers[0]
    inputs, outputs = len(first.knots), len(checkpoint.layers[-1].node_scale)
    if outputs != 1:
        raise InputError(f"{checkpoint.name}: {outputs} outputs; train one, the core temperature")
    for name, values in (
        ("center", scaling.input_center),
        ("half-range", scaling.input_half_range),
    ):
        if len(values) != inputs:
            raise InputError(f"--{name}: {len(values)} values for {inputs} inputs; give {inputs}")
    _require_scaled(checkpoint)
    for most in range(checkpoint.degree, 0, -1):
        network = _network(checkpoint, scaling, most)
        if fits_firmware(network):
            return network
    return _network(checkpoint, scaling, 0)


def _network(checkpoint: Checkpoint, scaling: Scaling, most_intervals: int) -> Network:
    layers: list[Layer] = []
    nodes = None if checkpoint.samples is None else np.clip(checkpoint.samples, -1.0, 1.0)
    for layer in checkpoint.layers:
        if nodes is None:
            layers.append(_layer(layer))
        else:
            layers.append(_layer(_widened(layer, checkpoint.degree, nodes, most_intervals)))
            nodes = _following(layers[-1], nodes, checkpoint.degree)
    inputs = len(checkpoint.layers[0].knots)
    return Network(
        checkpoint.degree,
        INPUT_NAMES
        if inputs == len(INPUT_NAMES)
        else tuple(f"x{number + 1}" for number in range(inputs)),
        tuple(scaling.input_center.tolist()),
        tuple(scaling.input_half_range.tolist()),
        scaling.output_center_K,
        scaling.output_half_range_K,
        tuple(layers),
    )


def _require_scaled(checkpoint: Checkpoint) -> None:
    """The silu of an edge is not free of scale, so other scales of inputs cannot be folded in."""
    degree = checkpoint.degree
    for source, knots in enumerate(checkpoint.layers[0].knots):
        low, high = knots[degree], knots[-degree - 1]
        if max(-low, high) > _WIDEST_GRID:
            raise InputError(
                f"{checkpoint.name}: layer 0, edges from input {source}: grid "
                f"{low:.4g}..{high:.4g} goes beyond -1..1; scale the inputs and train again"
            )


def _widened(layer: CheckpointLayer, degree: int, nodes: Array, most: int) -> CheckpointLayer:
    """The same functions on grids that reach as far as the nodes (N, in) do.

    On either side at most `most` of the k intervals of pykan's extension are added, and as many
    splines of zero weight beyond them.
    """
    below = above = 0
    for knots, column in zip(layer.knots, nodes.T):
        rounding = _FLOAT32_ROUNDING * float(np.ptp(knots))
        low, high = column.min() + rounding, column.max() - rounding
        below = max(below, int(np.sum(knots[1 : degree + 1] > low)))
        above = max(above, int(np.sum(knots[-degree - 1 : -1] < high)))
    below, above = min(below, most), min(above, most)
    step = np.diff(layer.knots).mean(axis=1, keepdims=True)
    return CheckpointLayer(
        np.hstack(
            [
                layer.knots[:, :1] - step * np.arange(below, 0, -1),
                layer.knots,
                layer.knots[:, -1:] + step * np.arange(1, above + 1),
            ]
        ),
        np.pad(layer.coefficients, ((0, 0), (0, 0), (below, above))),
        layer.base_scale,
        layer.spline_scale,
        layer.node_scale,
        layer.node_shift,
    )


def _layer(layer: CheckpointLayer) -> Layer:
    return tuple(
        tuple(_edge(layer, source, target) for source in range(len(layer.knots)))
        for target in range(len(layer.node_scale))
    )


def _edge(layer: CheckpointLayer, source: int, target: int) -> Edge:
    scale = float(layer.node_scale[target])
    base_weight = scale * float(layer.base_scale[source, target])
    spline_weight = scale * float(layer.spline_scale[source, target])
    coefficients = layer.coefficients[source, target]
    shift = float(layer.node_shift[target]) if source == 0 else 0.0
    if shift:
        coefficients, spline_weight = spline_weight * coefficients + shift, 1.0
    return Edge(
        tuple(layer.knots[source].tolist()),
        base_weight,
        spline_weight,
        tuple(coefficients.tolist()),
    )


def _following(layer: Layer, nodes: Array, degree: int) -> Array:
    """Nodes (N, out) that the layer makes of nodes (N, in)."""
    return np.stack(
        [
            np.sum([edge.evaluate(nodes[:, i], degree)[0] for i, edge in enumerate(row)], axis=0)
            for row in layer
        ],
        axis=1,
    )
