"""Edge functions as polynomial tables, the form in which the firmware evaluates the network.

Each grid cell of an edge becomes one polynomial of fixed degree in the distance from the cell's
middle. The spline part is reproduced exactly; the base function silu is interpolated at Chebyshev
nodes, so that the firmware needs no exponential. Cells are halved until the error is small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from bms.arrays import Array
from bms.data.lags import QUANTITIES, Lags, settling_time_s
from bms.errors import InputError
from bms.kan.network import Edge, Network
from bms.tables.edge_polynomials import edge_polynomial

MAX_LAYERS, MAX_WIDTH, MAX_KNOTS, MAX_COEFFICIENTS = 3, 8, 128, 512
MAX_LAGS, MAX_DIRECTIONS = 4, 8
"""The firmware's compile-time maxima (firmware_c/include/kan.h)."""
CELL_COEFFICIENTS = 8
TABLE_ERROR_K = 1e-5
"""Cells are halved until the bound on the table's error is below this, or the tables are full."""


@dataclass(frozen=True)
class EdgeTable:
    """Polynomials of one edge: knots (cells + 1,), coefficients (cells, 8) constant term first."""

    knots: Array
    coefficients: Array
    worst_error: float
    steepest: float


@dataclass(frozen=True)
class NetworkTables:
    """Tables of all edges in the order of Network.edges, and the bound on their error in K."""

    width: tuple[int, ...]
    cells: int
    edges: tuple[EdgeTable, ...]
    error_bound_K: float

    def fields(self, network: Network, sampling_period_s: float) -> dict[str, Any]:
        """Content of the firmware's kan_model_t for readings every `sampling_period_s`."""
        return {
            "layers": len(self.width) - 1,
            "cells": self.cells,
            "width": list(self.width),
            **_memory_fields(network.lags, sampling_period_s),
            **_domain_fields(network),
            "spans_reach": int(self._spans(network.reach)),
            "input_center": list(network.input_center),
            "input_scale": [1.0 / half for half in network.input_half_range],
            "output_center_K": network.output_center_K,
            "output_half_range_K": network.output_half_range_K,
            "tables": np.concatenate(
                [part for e in self.edges for part in (e.knots, e.coefficients.ravel())]
            ).tolist(),
        }

    def _spans(self, reach: float) -> bool:
        """Whether the first layer's knots span normalised inputs up to the reach, as float32."""
        from_inputs = self.edges[: self.width[0] * self.width[1]]
        return all(
            edge.knots[0] <= -np.float32(reach) and edge.knots[-1] >= np.float32(reach)
            for edge in from_inputs
        )


def _memory_fields(lags: Lags, sampling_period_s: float) -> dict[str, Any]:
    if not lags:
        return {}
    return {
        "lags": len(lags),
        "settling_periods": math.ceil(settling_time_s(lags) / sampling_period_s),
        "lag": [
            {
                "quantity": QUANTITIES.index(lag.quantity),
                "decay": lag.decay(sampling_period_s),
                "gain": lag.gain(sampling_period_s),
            }
            for lag in lags
        ],
    }


def _domain_fields(network: Network) -> dict[str, Any]:
    domain = network.domain
    if not domain.directions:
        return {"input_reach": network.reach}
    return {
        "input_reach": network.reach,
        "directions": len(domain.directions),
        "direction": [
            {"component": list(direction), "low": low, "high": high}
            for direction, low, high in zip(domain.directions, domain.low, domain.high)
        ],
    }


def network_tables(network: Network) -> NetworkTables:
    """Tables of a network; InputError names the maximum that it does not fit."""
    degree = network.degree
    if degree >= CELL_COEFFICIENTS:
        raise InputError(f"network: degree {degree} exceeds the firmware's {CELL_COEFFICIENTS - 1}")
    edges = network.edges
    grid = max(len(edge.knots) - 1 - 2 * degree for edge in edges)
    tables = _build(network, edges, grid, 1)
    halvings = 1
    while tables.error_bound_K > TABLE_ERROR_K and _fits(network, len(edges), grid * halvings * 2):
        halvings *= 2
        tables = _build(network, edges, grid, halvings)
    if not _fits(network, len(edges), tables.cells):
        raise InputError(
            f"network of width {list(network.width)} and {grid} grid cells: exceeds the firmware's "
            f"maxima ({MAX_LAYERS} layers of {MAX_WIDTH}, {MAX_COEFFICIENTS} coefficients); "
            "train a smaller one"
        )
    return tables


def _fits(network: Network, edges: int, cells: int) -> bool:
    return (
        len(network.layers) <= MAX_LAYERS
        and max(network.width) <= MAX_WIDTH
        and len(network.lags) <= MAX_LAGS
        and len(network.domain.directions) <= MAX_DIRECTIONS
        and edges * (cells + 1) <= MAX_KNOTS
        and edges * cells * CELL_COEFFICIENTS <= MAX_COEFFICIENTS
    )


def _build(network: Network, edges: list[Edge], grid: int, halvings: int) -> NetworkTables:
    tables = tuple(_edge_table(edge, network.degree, grid, halvings) for edge in edges)
    return NetworkTables(
        network.width, grid * halvings, tables, _error_bound_K(network, list(tables))
    )


def _edge_table(edge: Edge, degree: int, grid: int, halvings: int) -> EdgeTable:
    own = np.asarray(edge.knots[degree : len(edge.knots) - degree])
    per_cell = grid * halvings // (len(own) - 1)
    extra = grid * halvings - per_cell * (len(own) - 1)
    pieces = [
        np.linspace(low, high, per_cell + (1 if i < extra else 0) + 1)[:-1]
        for i, (low, high) in enumerate(pairwise(own))
    ]
    knots = np.append(np.concatenate(pieces), own[-1]).astype(np.float32).astype(np.float64)
    coefficients, worst, steepest = [], 0.0, 0.0
    for low, high in pairwise(knots):
        polynomial = Polynomial(edge_polynomial(edge, degree, low, high, CELL_COEFFICIENTS))
        coefficients.append(polynomial.coef)
        probe = np.linspace(low, high, 257)
        distance = probe - 0.5 * (low + high)
        error = polynomial(distance) - edge.evaluate(probe, degree)[0]
        worst = max(worst, float(np.max(np.abs(error))))
        steepest = max(steepest, float(np.max(np.abs(polynomial.deriv()(distance)))))
    return EdgeTable(knots, np.asarray(coefficients), worst, steepest)


def _error_bound_K(network: Network, tables: list[EdgeTable]) -> float:
    """Bound on the table's error in K: edge errors add up and are amplified by later slopes."""
    errors = [0.0] * len(network.input_names)
    position = 0
    for layer in network.layers:
        following = []
        for row in layer:
            own = tables[position : position + len(row)]
            position += len(row)
            following.append(
                sum(edge.worst_error + edge.steepest * e for edge, e in zip(own, errors))
            )
        errors = following
    return network.output_half_range_K * errors[0]
