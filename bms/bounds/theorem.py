"""Sweep over the grid: how fast networks of splines approach a smooth one of the same width.

The theorem is about a composition h of smooth functions. Of data with a floor that no static map
can pass, the best such h is approached by a network whose every edge is one polynomial; networks of
G intervals are then fitted to it, each from the next coarser one, over data and box alike. Their
distance to h falls as M G^-(k+1) where G is fine enough to follow h; the distance of h to the
data, the floor, does not fall at all. Source: paper, theorem 1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from bms.bounds.fitting import Layers, Points, fitted
from bms.bounds.rate import fit_rate
from bms.bounds.record import TheoremBound
from bms.data.simulate import Samples
from bms.kan.basis import Array, basis, silu, uniform_knots
from bms.kan.network import Layer, Network
from bms.kan.trainable import TrainableLayer, forward

GRIDS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
_MOST_PARAMETERS = 500
_SMOOTH_ORDERS_BEYOND = 5
_FITTED, _MEASURED = 2**11, 2**14
_HIDDEN_MARGIN = 0.05
_PROBES = 40

Spans = list[list[tuple[float, float]]]
SplineParts = Callable[[int, Array], Array]


def theorem_bound(network: Network, data: Samples, seed: int) -> TheoremBound:
    """Sweep for networks of this one's width and degree, on the data that it was trained on."""
    rng = np.random.default_rng(seed)
    points = _normalised(network, data, rng.permutation(len(data.inputs))[:_MEASURED])
    box = rng.uniform(-1.0, 1.0, (len(points.x), _MEASURED))
    spans = _spans(network, points.x)
    smooth = _smooth(network, spans, points)
    on_data, on_box = forward(smooth, points.x)[0], forward(smooth, box)[0]
    mixed = np.hstack([points.x[:, :_FITTED], box[:, :_FITTED]])
    target = Points(mixed, forward(smooth, mixed)[0])

    found: dict[int, Layers] = {}
    largest, rms = [], []
    for grid in _grids(network):
        coarser = max((g for g in found if grid % g == 0), default=None)
        start = smooth if coarser is None else found[coarser]
        found[grid] = fitted(_regridded(start, grid, network.degree, spans), target)
        apart = forward(found[grid], points.x)[0] - on_data
        beyond = forward(found[grid], box)[0] - on_box
        largest.append(max(float(np.abs(apart).max()), float(np.abs(beyond).max())))
        rms.append(float(np.sqrt(np.mean(apart**2))))
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


def _normalised(network: Network, data: Samples, rows: npt.NDArray[np.int64]) -> Points:
    center, half_range = np.asarray(network.input_center), np.asarray(network.input_half_range)
    x = np.ascontiguousarray(((data.inputs[rows] - center) / half_range).T)
    core_K = data.core_temperature_K[rows]
    return Points(x, (core_K - network.output_center_K) / network.output_half_range_K)


def _own_grid(network: Network) -> int:
    """Intervals of the network's finest edge."""
    knots = max(len(edge.knots) for layer in network.layers for row in layer for edge in row)
    return knots - 1 - 2 * network.degree


def _grids(network: Network) -> list[int]:
    """Grids whose networks stay small enough to be fitted quickly; three at least."""
    edges = sum(a * b for a, b in zip(network.width, network.width[1:]))
    small = [g for g in GRIDS if edges * (g + network.degree + 2) <= _MOST_PARAMETERS]
    return small if len(small) >= 3 else list(GRIDS[:3])


def _spans(network: Network, x: Array) -> Spans:
    """Range of every node: -1..1 for the inputs, of hidden ones what the data reach and 5 %."""
    spans: Spans = [[(-1.0, 1.0)] * len(x)]
    nodes = np.clip(x, -1.0, 1.0)
    for layer in network.layers[:-1]:
        nodes = np.stack(
            [
                np.sum([e.evaluate(v, network.degree)[0] for e, v in zip(row, nodes)], axis=0)
                for row in layer
            ]
        )
        margins = [_HIDDEN_MARGIN * max(float(np.ptp(node)), 1e-3) for node in nodes]
        spans.append([(float(v.min()) - m, float(v.max()) + m) for v, m in zip(nodes, margins)])
    return spans


def _smooth(network: Network, spans: Spans, points: Points) -> Layers:
    """Network with one polynomial for each edge, fitted to the data from the given network on."""
    order = network.degree + _SMOOTH_ORDERS_BEYOND
    layers = []
    for layer, ranges in zip(network.layers, spans):

        def parts(source: int, x: Array, layer: Layer = layer) -> Array:
            edges = [row[source] for row in layer]
            return np.stack(
                [e.evaluate(x, network.degree)[0] - e.base_weight * silu(x) for e in edges]
            )

        base_weights = np.array([[edge.base_weight for edge in row] for row in layer])
        layers.append(_layer(order, 1, ranges, base_weights, parts))
    return fitted(layers, points)


def _regridded(layers: Layers, grid: int, degree: int, spans: Spans) -> Layers:
    """The same functions on uniform grids; exact when each grid holds the former one's knots."""
    new = []
    for layer, ranges in zip(layers, spans):

        def parts(source: int, x: Array, layer: TrainableLayer = layer) -> Array:
            weighted = layer.spline_weights[:, [source]] * layer.coefficients[:, source]
            return np.asarray(weighted @ basis(x, layer.knots[source], layer.degree))

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
