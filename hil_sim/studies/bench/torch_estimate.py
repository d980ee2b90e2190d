"""Ways to the core temperature that need PyTorch: pykan's forward pass, and a perceptron."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from bms.arrays import Array
from bms.studies.rivals.kan import trained_parameters
from bms.studies.rivals.perceptron import Perceptron, hidden_nodes
from hil_sim.studies.bench.estimate import FEW, TOLERANCE_K, normalised
from hil_sim.studies.bench.machine import package
from hil_sim.studies.bench.problem import Problem
from hil_sim.studies.bench.race import Peer, Rows


def pykan_estimates(problem: Problem) -> list[Peer]:
    """The network in pykan, without its symbolic part and its records; ImportError without it."""
    from kan import KAN  # noqa: PLC0415 (an optional extra)

    network = problem.firmware.model.network
    intervals = len(network.layers[0][0][0].knots) - 1 - 2 * network.degree
    model = KAN(list(network.width), intervals, network.degree, auto_save=False).speed()
    with torch.no_grad():
        for layer, functions in zip(network.layers, model.act_fun):
            for target, row in enumerate(layer):
                for source, edge in enumerate(row):
                    functions.grid[source] = torch.tensor(edge.knots)
                    functions.coef[source, target] = torch.tensor(edge.coefficients)
                    functions.scale_base[source, target] = edge.base_weight
                    functions.scale_sp[source, target] = edge.spline_weight

    def evaluate(x: Any) -> Array:
        y: Array = model(x).numpy()[:, 0].astype(np.float64)
        return network.output_center_K + network.output_half_range_K * y

    rows = torch.tensor(normalised(problem), dtype=torch.float32)
    return _one_by_one_and_all(
        "KAN in pykan", package("pykan"), evaluate, rows, TOLERANCE_K, problem.sample(FEW)
    )


@dataclass(frozen=True)
class TorchPerceptron:
    """Two peers, and what they have to answer: they are no estimators of the core temperature."""

    peers: list[Peer]
    reference: Array


def torch_perceptron(problem: Problem) -> TorchPerceptron:
    """A perceptron with one hidden layer and at least as many parameters as the network.

    Its weights are drawn, because time does not depend on them; its answers have to be those of the
    same weights in bms.studies.rivals.
    """
    torch.set_num_threads(1)
    nodes = hidden_nodes(trained_parameters(problem.firmware.model.network))
    x = normalised(problem)
    weights = np.random.default_rng(0).standard_normal(nodes * (x.shape[1] + 2) + 1)
    perceptron = Perceptron.of(weights, nodes)
    hidden, output = torch.nn.Linear(x.shape[1], nodes), torch.nn.Linear(nodes, 1)
    with torch.no_grad():
        hidden.weight[:] = torch.tensor(perceptron.hidden)
        hidden.bias[:] = torch.tensor(perceptron.bias)
        output.weight[0] = torch.tensor(perceptron.output)
        output.bias[0] = perceptron.offset
    model = torch.nn.Sequential(hidden, torch.nn.Tanh(), output)
    peers = _one_by_one_and_all(
        f"MLP [{x.shape[1]},{nodes},1] in PyTorch",
        package("torch"),
        lambda rows: model(rows).numpy()[:, 0].astype(np.float64),
        torch.tensor(x, dtype=torch.float32),
        1e-4,
        problem.sample(FEW),
    )
    return TorchPerceptron(peers, perceptron.values(x))


def _one_by_one_and_all(
    name: str, library: str, evaluate: Any, rows: Any, tolerance: float, few: Rows
) -> list[Peer]:
    def one_by_one() -> Array:
        with torch.no_grad():
            return np.concatenate([evaluate(rows[n : n + 1]) for n in few])

    def at_once() -> Array:
        with torch.no_grad():
            answers: Array = evaluate(rows)
            return answers

    return [
        Peer(f"{name}, one at a time", library, one_by_one, tolerance, few),
        Peer(f"{name}, in one batch", library, at_once, tolerance),
    ]
