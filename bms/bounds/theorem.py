"""Sweep over the grid: how fast networks of splines approach a smooth one of the same width.

The theorem is about a composition h of smooth functions. Of data with a floor that no static map
can pass, the best such h is approached by a network whose every edge is one polynomial; networks of
G intervals are then fitted to it, each from the next coarser one, over data and box alike (where
the box leads to hidden values that the data reach). Their distance to h falls as M G^-(k+1) where
G is fine enough to follow h; the distance of h to the data, the floor, does not fall at all.
Source: paper, theorem 1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bms.arrays import Array, IntArray
from bms.bounds.fitting import Layers, Points, fitted
from bms.bounds.rate import fit_rate
from bms.bounds.record import TheoremBound
from bms.data.simulate import Samples
from bms.kan.basis import basis, uniform_knots
from bms.kan.network import Network
from bms.kan.trainable import TrainableLayer, forward
from bms.progress import Progress, to_nobody

GRIDS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
_MOST_PARAMETERS = 500
_SMOOTH_ORDERS_BEYOND = 5
_FITTED, _MEASURED = 2**11, 2**14
_FIRST_MARGIN, _HIDDEN_MARGIN = 0.2, 0.05
_PROBES = 40
_AT_ENDS = 2**6

Spans = list[list[tuple[float, float]]]
SplineParts = Callable[[int, Array], Array]


def theorem_bound(
    network: Network, data: Samples, seed: int, progress: Progress = to_nobody
) -> TheoremBound:
    """Sweep for networks of this one's width and degree, on the data that it was trained on."""
    rng = np.random.default_rng(seed)
    points = _normalised(network, data, rng.permutation(len(data.inputs))[:_MEASURED])
    smooth = _smooth(network, points)
    spans = _spans(smooth, points.x, _HIDDEN_MARGIN)
    box = _within(
        smooth, _spans(smooth, points.x, 0.0), rng.uniform(-1.0, 1.0, (len(points.x), _MEASURED))
    )
    on_data, on_box = forward(smooth, points.x)[0], forward(smooth, box)[0]
    mixed = np.hstack([_chosen(smooth, points.x), _chosen(smooth, box)])
    target = Points(mixed, forward(smooth, mixed)[0])

    found: dict[int, Layers] = {}
    largest, rms = [], []
    grids = _grids(network)
    for number, grid in enumerate(grids):
        coarser = max((g for g in found if grid % g == 0), default=None)
        start = smooth if coarser is None else found[coarser]
        found[grid] = fitted(_regridded(start, grid, network.degree, spans), target)
        apart = forward(found[grid], points.x)[0] - on_data
        beyond = forward(found[grid], box)[0] - on_box
        largest.append(max(float(np.abs(apart).max()), float(np.abs(beyond).max())))
        rms.append(float(np.sqrt(np.mean(apart**2))))
        progress((number + 1) / len(grids))
    span_K, floor = network.output_half_range_K, on_data - points.y
    return _record(
        network,
        tuple(found),
        (span_K * np.array(largest), span_K * np.array(rms)),
        span_K * floor,
    )


def _record(
    network: Network, grids: tuple[int, ...], apart_K: tuple[Array, Array], floor_K: Array
) -> TheoremBound:
    largest_K, rms_K = (tuple(part.tolist()) for part in apart_K)
    order, own = network.degree + 1, _own_grid(network)
    rate = fit_rate(grids, largest_K, order)
    holds = rate is not None and rate.first_grid <= own <= rate.last_grid
    return TheoremBound(
        grids,
        largest_K,
        rms_K,
        order,
        rate,
        own,
        rate.constant_K * float(own) ** -order if rate is not None and holds else None,
        float(np.abs(floor_K).max()),
        float(np.sqrt(np.mean(floor_K**2))),
    )


def _normalised(network: Network, data: Samples, rows: IntArray) -> Points:
    center, half_range = np.asarray(network.input_center), np.asarray(network.input_half_range)
    x = np.ascontiguousarray(((data.inputs[rows] - center) / half_range).T)
    core_K = data.core_temperature_K[rows]
    return Points(x, (core_K - network.output_center_K) / network.output_half_range_K)


def _own_grid(network: Network) -> int:
    """Intervals of the network's finest edge."""
    knots = max(len(edge.knots) for edge in network.edges)
    return knots - 1 - 2 * network.degree


def _grids(network: Network) -> list[int]:
    """Grids whose networks stay small enough to be fitted quickly; three at least."""
    edges = sum(a * b for a, b in zip(network.width, network.width[1:]))
    small = [g for g in GRIDS if edges * (g + network.degree + 2) <= _MOST_PARAMETERS]
    return small if len(small) >= 3 else list(GRIDS[:3])


def _hidden(layers: Layers, x: Array) -> list[Array]:
    """Values of all hidden nodes, layer by layer, (out, N) each."""
    return [forward(layers[:number], x) for number in range(1, len(layers))]


def _spans(layers: Layers, x: Array, margin: float) -> Spans:
    """Range of every node: -1..1 for the inputs, of hidden ones what x reaches and a margin."""
    spans: Spans = [[(-1.0, 1.0)] * len(x)]
    for nodes in _hidden(layers, x):
        beyond = margin * np.maximum(np.ptp(nodes, axis=1), 1e-3)
        low, high = nodes.min(axis=1) - beyond, nodes.max(axis=1) + beyond
        spans.append(list(zip(low.tolist(), high.tolist())))
    return spans


def _within(layers: Layers, spans: Spans, x: Array) -> Array:
    """Those columns of x whose hidden values lie in the spans; others would not be trusted."""
    inside = np.ones(x.shape[1], dtype=np.bool_)
    for nodes, ranges in zip(_hidden(layers, x), spans[1:]):
        low, high = np.transpose(np.asarray(ranges))[:, :, None]
        inside &= np.all((nodes >= low) & (nodes <= high), axis=0)
    return np.ascontiguousarray(x[:, inside])


def _smooth(network: Network, points: Points) -> Layers:
    """Network with one polynomial for each edge, fitted to the data from the given network on."""
    own = _as_layers(network)
    order = network.degree + _SMOOTH_ORDERS_BEYOND
    smooth = _regridded(own, 1, order, _spans(own, points.x, _FIRST_MARGIN))
    smooth = fitted(smooth, points)
    return fitted(_regridded(smooth, 1, order, _spans(smooth, points.x, _HIDDEN_MARGIN)), points)


def _chosen(layers: Layers, x: Array) -> Array:
    """The first columns of x, and those at either end of every hidden node's range."""
    ends = [
        np.concatenate([order[:_AT_ENDS], order[-_AT_ENDS:]])
        for nodes in _hidden(layers, x)
        for order in np.argsort(nodes, axis=1)
    ]
    return x[:, np.unique(np.concatenate([np.arange(min(_FITTED, x.shape[1])), *ends]))]


def _as_layers(network: Network) -> Layers:
    """The network for a fit; the edges that leave one node must share its knots."""
    layers = []
    for layer in network.layers:
        coefficients = [[e.coefficients for e in row] for row in layer]
        layers.append(
            TrainableLayer(
                network.degree,
                np.array([edge.knots for edge in layer[0]]),
                np.array([[edge.base_weight for edge in row] for row in layer]),
                np.array([[edge.spline_weight for edge in row] for row in layer]),
                np.array(coefficients),
            )
        )
    return layers


def _regridded(layers: Layers, grid: int, degree: int, spans: Spans) -> Layers:
    """The same functions on uniform grids; exact when each grid holds the former one's knots."""
    new = []
    for layer, ranges in zip(layers, spans):

        def parts(source: int, x: Array, layer: TrainableLayer = layer) -> Array:
            weighted = layer.spline_weights[:, [source]] * layer.coefficients[:, source]
            low, high = layer.knots[source][[layer.degree, -layer.degree - 1]]
            return np.asarray(
                weighted @ basis(np.clip(x, low, high), layer.knots[source], layer.degree)
            )

        new.append(_layer(degree, grid, ranges, layer.base_weights, parts))
    return new


def _layer(
    degree: int,
    grid: int,
    ranges: list[tuple[float, float]],
    base_weights: Array,
    parts: SplineParts,
) -> TrainableLayer:
    """Layer whose splines are the least-squares fit to `parts(source, x)`, of shape (out, N)."""
    knots, coefficients = [], []
    for source, (low, high) in enumerate(ranges):
        knots.append(uniform_knots(low, high, grid, degree))
        x = np.linspace(low, high, _PROBES * (grid + degree))
        design = basis(x, knots[-1], degree).T
        coefficients.append(np.linalg.lstsq(design, parts(source, x).T, rcond=None)[0].T)
    return TrainableLayer(
        degree,
        np.stack(knots),
        base_weights,
        np.ones_like(base_weights),
        np.stack(coefficients, axis=1),
    )
