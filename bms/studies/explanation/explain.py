"""Explanation of a network by the data that reach it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from itertools import count

import numpy as np

from bms.arrays import Array
from bms.kan.domain import EVERYWHERE
from bms.kan.network import Edge, Network
from bms.progress import Progress, to_nobody
from bms.studies.explanation.approximation import Approximation
from bms.studies.explanation.fitting import Candidate, candidates, chosen
from bms.studies.explanation.formula import Formula, evaluate, formula
from bms.studies.explanation.propagation import node_gains_K, node_values, sensitivities

_BINS = 200
_BOX_POINTS = 8192
_BOX_SEED = 0
_LEAST_GAIN_K = 1e-6


@dataclass(frozen=True)
class EdgeExplanation:
    """One edge with its approximation; x is physical on the first layer, a node value behind it.

    On the last layer values are in K, elsewhere those of the node. Errors are in kelvin of the
    estimate: the edge's error at every sample times how much the node behind it moves the estimate.
    `density` (200,) is the share of the data in each of the bins that `bins` (201,) bound.
    """

    layer: int
    source: int
    target: int
    x: Array
    values: Array
    bins: Array
    density: Array
    approximation: Approximation
    rmse_K: float
    max_abs_error_K: float
    r_squared: float
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True)
class Sensitivity:
    """dThat/dx of one input, in kelvin for each unit of it, over the data and over the box.

    Of the box only those combinations of inputs count that the network can tell apart: all hidden
    values lie within their grids.
    """

    name: str
    data_x: Array
    data_K: Array
    box_x: Array
    box_K: Array


@dataclass(frozen=True)
class Explanation:
    """All edges [layer][out][in], the formula they make with its errors to the network in K."""

    edges: tuple[tuple[tuple[EdgeExplanation, ...], ...], ...]
    formula: Formula
    formula_rmse_K: float
    formula_max_abs_error_K: float
    sensitivities: tuple[Sensitivity, ...]


def explain(network: Network, inputs: Array, progress: Progress = to_nobody) -> Explanation:
    """Explanation of a network over data whose inputs (N, n_in) are physical."""
    values = node_values(network, inputs)
    gains_K = node_gains_K(network, values)
    done = count(1)
    edge_count = sum(len(row) for layer in network.layers for row in layer)

    def explained(place: tuple[int, int, int], edge: Edge) -> EdgeExplanation:
        explanation = _edge(network, place, edge, values, gains_K)
        progress(next(done) / edge_count)
        return explanation

    edges = tuple(
        tuple(
            tuple(explained((number, source, target), edge) for source, edge in enumerate(row))
            for target, row in enumerate(layer)
        )
        for number, layer in enumerate(network.layers)
    )
    approximations = [[[edge.approximation for edge in row] for row in layer] for layer in edges]
    trusted = _physical(network, values[0])
    error_K = (
        evaluate(trusted, approximations, network.output_center_K)
        - network.output_center_K
        - network.output_half_range_K * values[-1][:, 0]
    )
    return Explanation(
        edges,
        formula(network.input_names, approximations, network.output_center_K),
        float(np.sqrt(np.mean(error_K**2))),
        float(np.abs(error_K).max()),
        _sensitivities(network, inputs),
    )


def _edge(
    network: Network,
    place: tuple[int, int, int],
    edge: Edge,
    nodes: list[Array],
    gains_K: list[Array],
) -> EdgeExplanation:
    layer, source, target = place
    is_last = layer == len(network.layers) - 1
    unit = network.output_half_range_K if is_last else 1.0
    center, half = 0.0, 1.0
    if layer == 0:
        center, half = network.input_center[source], network.input_half_range[source]

    def function(x: Array) -> Array:
        return unit * edge.evaluate((x - center) / half, network.degree)[0]

    samples = center + half * nodes[layer][:, source]
    gain_K = np.maximum(np.abs(gains_K[layer + 1][:, target]) / unit, _LEAST_GAIN_K)
    bins, density, weights_K2 = _histogram(samples, gain_K)
    middles = 0.5 * (bins[1:] + bins[:-1])
    reached = density > 0.0
    if np.ptp(samples) == 0.0:
        middles, reached, weights_K2 = samples[:1], np.array([True]), np.array([weights_K2.sum()])
    found = candidates(middles[reached], function(middles[reached]), weights_K2[reached])
    best = chosen(found)
    error_K = gain_K * np.abs(best.approximation(samples) - function(samples))
    low, high = (center + half * edge.knots[i] for i in (network.degree, -network.degree - 1))
    x = np.linspace(low, high, 2 * _BINS + 1)
    return EdgeExplanation(
        *place,
        x,
        function(x),
        bins,
        density,
        best.approximation,
        float(np.sqrt(np.mean(error_K**2))),
        float(error_K.max()),
        best.r_squared,
        tuple(found),
    )


def _histogram(samples: Array, gain_K: Array) -> tuple[Array, Array, Array]:
    """Bounds of the bins, share of the samples in each, and share times mean squared gain."""
    counts, bins = np.histogram(samples, _BINS)
    squared_gains = np.histogram(samples, bins, weights=gain_K**2)[0]
    return bins, counts / len(samples), squared_gains / len(samples)


def _physical(network: Network, normalised: Array) -> Array:
    physical: Array = np.asarray(network.input_center) + normalised * np.asarray(
        network.input_half_range
    )
    return physical


def _sensitivities(network: Network, inputs: Array) -> tuple[Sensitivity, ...]:
    points = np.random.default_rng(_BOX_SEED).uniform(
        -1.0, 1.0, (_BOX_POINTS, len(network.input_names))
    )
    box = _physical(network, points)
    # Where a hidden value leaves its grid the estimate is flagged and stands still.
    box = box[dataclasses.replace(network, domain=EVERYWHERE).evaluate(box)[1]]
    over_data, over_box = sensitivities(network, inputs), sensitivities(network, box)
    return tuple(
        Sensitivity(name, inputs[:, i], over_data[:, i], box[:, i], over_box[:, i])
        for i, name in enumerate(network.input_names)
    )
