"""Ways to the core temperature: the firmware's network in C, and the same network elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from bms.arrays import Array
from bms.firmware.batches import EstimateBatch
from bms.kan.network import INPUT_NAMES, Edge, Network
from hil_sim.studies.bench.machine import THIS_PROJECT, package
from hil_sim.studies.bench.problem import Problem
from hil_sim.studies.bench.race import Peer

TOLERANCE_K = 2e-3
"""A third of the estimate's own error: the firmware rounds to tables and to float32."""
FEW, SOME = 100, 1000
"""How many estimates are timed where each is a call of its own."""


def estimate_in_c(problem: Problem) -> Peer:
    """The firmware's estimate in a loop in C."""
    firmware = problem.firmware
    batch = EstimateBatch(firmware.preset, firmware.model, problem.inputs)

    def solve() -> Array:
        return batch.run().astype(np.float64)

    return Peer("KAN in C", THIS_PROJECT, solve, TOLERANCE_K)


def estimate_from_python(problem: Problem) -> Peer:
    """The firmware's estimate, each a call of bms.firmware.Firmware."""
    rows = problem.sample(SOME)
    calls = [dict(zip(INPUT_NAMES, row)) for row in problem.inputs[rows].tolist()]
    estimate: Any = problem.firmware.estimate

    def solve() -> Array:
        return np.array([estimate(**call).core_temperature_K for call in calls])

    return Peer("KAN in C, called from Python", THIS_PROJECT, solve, TOLERANCE_K, rows)


def scipy_estimates(problem: Problem) -> list[Peer]:
    """The network's edges as splines of SciPy, for one row of inputs at a time and for all."""
    network = problem.firmware.model.network
    layers = [
        [[_edge(edge, network.degree) for edge in row] for row in layer] for layer in network.layers
    ]

    def evaluate(inputs: Any) -> Any:
        nodes = inputs
        for layer in layers:
            nodes = [sum(edge(x) for edge, x in zip(row, nodes)) for row in layer]
        return network.output_center_K + network.output_half_range_K * nodes[0]

    columns = normalised(problem).T
    few = problem.sample(FEW)
    rows = [tuple(row) for row in columns.T[few]]
    return [
        Peer(
            "KAN in SciPy, one at a time",
            package("scipy"),
            lambda: np.array([evaluate(row) for row in rows]),
            TOLERANCE_K,
            few,
        ),
        Peer(
            "KAN in SciPy, in one batch", package("scipy"), lambda: evaluate(columns), TOLERANCE_K
        ),
    ]


def normalised(problem: Problem) -> Array:
    """Inputs (N, 4) as the network's layers take them; nobody is timed for this."""
    network: Network = problem.firmware.model.network
    inputs: Array = (problem.inputs - network.input_center) / network.input_half_range
    return inputs


def _edge(edge: Edge, degree: int) -> Any:
    spline = BSpline(
        np.asarray(edge.knots), edge.spline_weight * np.asarray(edge.coefficients), degree
    )
    return lambda x: spline(x) + edge.base_weight * x / (1.0 + np.exp(-x))
