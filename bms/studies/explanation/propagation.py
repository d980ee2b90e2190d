"""What data make of the nodes of a network, and how much every node moves the estimate."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.kan.basis import basis_slope, silu_slope
from bms.kan.network import Edge, Network


def node_values(network: Network, inputs: Array) -> list[Array]:
    """Values (N, nodes) of the normalised inputs and of each layer, for inputs (N, n_in)."""
    normalised = (inputs - np.asarray(network.input_center)) / np.asarray(network.input_half_range)
    values = [np.clip(normalised, -network.reach, network.reach)]
    for layer in network.layers:
        columns = [
            sum(edge.evaluate(values[-1][:, i], network.degree)[0] for i, edge in enumerate(row))
            for row in layer
        ]
        values.append(np.stack(columns, axis=1))
    return values


def node_gains_K(network: Network, values: list[Array]) -> list[Array]:
    """Derivative of the estimate by each node, in K, shaped as `values` from node_values."""
    gains = [np.full_like(values[-1], network.output_half_range_K)]
    for layer, nodes in zip(reversed(network.layers), reversed(values[:-1])):
        behind = gains[0]
        own = np.zeros_like(nodes)
        for target, row in enumerate(layer):
            for source, edge in enumerate(row):
                own[:, source] += behind[:, target] * edge_slope(
                    edge, nodes[:, source], network.degree
                )
        gains.insert(0, own)
    return gains


def edge_slope(edge: Edge, x: Array, degree: int) -> Array:
    """Derivative of the edge function at x (N,); 0 beyond the grid, where it keeps its value."""
    low, high = edge.knots[degree], edge.knots[-degree - 1]
    clamped = np.clip(x, low, high)
    slopes = basis_slope(clamped, np.asarray(edge.knots), degree)
    spline = np.asarray(edge.coefficients) @ slopes
    slope = edge.base_weight * silu_slope(clamped) + edge.spline_weight * spline
    inside = (x >= low) & (x <= high)
    return np.where(inside, slope, 0.0)


def sensitivities(network: Network, inputs: Array) -> Array:
    """dThat/dx (N, n_in) in kelvin for each unit of the input, at inputs (N, n_in).

    0 where the input is beyond the network's reach.
    """
    half_range = np.asarray(network.input_half_range)
    within = np.abs(inputs - np.asarray(network.input_center)) <= network.reach * half_range
    gains_K = node_gains_K(network, node_values(network, inputs))[0]
    return np.where(within, gains_K / half_range, 0.0)
