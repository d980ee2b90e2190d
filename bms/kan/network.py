"""The Kolmogorov-Arnold network as plain numbers, and its evaluation in double precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge

from bms.arrays import Array, Mask
from bms.data.lags import Lags
from bms.errors import InputError
from bms.kan.basis import basis, silu
from bms.kan.domain import EVERYWHERE, Domain
from bms.validation import Count, Finite, Positive, strict

INPUT_NAMES = (
    "current_A",
    "cooling_power_W",
    "surface_temperature_K",
    "coolant_temperature_K",
)


@strict
@dataclass(frozen=True)
class Edge:
    """phi(x) = base_weight silu(x) + spline_weight sum_i coefficients[i] B_i(x).

    `knots` holds a grid of G intervals and `degree` more knots on each side (G + 1 + 2 degree
    values); there are G + degree coefficients. Beyond its grid phi keeps the value of the end.
    """

    knots: tuple[Finite, ...]
    base_weight: Finite
    spline_weight: Finite
    coefficients: tuple[Finite, ...]

    def evaluate(self, x: Array, degree: int) -> tuple[Array, Mask]:
        """phi(x) and whether x lies within the grid, both of shape (N,), for x of shape (N,)."""
        low, high = self.knots[degree], self.knots[-degree - 1]
        clamped = np.clip(x, low, high)
        spline = np.asarray(self.coefficients) @ basis(clamped, np.asarray(self.knots), degree)
        phi = self.base_weight * silu(clamped) + self.spline_weight * spline
        return phi, (x >= low) & (x <= high)


Layer = tuple[tuple[Edge, ...], ...]


@strict
@dataclass(frozen=True)
class Network:
    """Layers of edges, layers[n][out][in], with the scaling of inputs and output.

    Inputs become (x - center)/half_range, so that the trained box is -1..1; the output y becomes
    output_center_K + output_half_range_K y. Source: paper, section "KAN structure". Of the inputs,
    the last `lags` are filtered ones. Inputs beyond -1..1 or out of `domain`, which holds
    normalised inputs, are flagged; they act as far as -reach..reach.
    Raises InputError when shapes do not fit together or knots do not rise.
    """

    degree: Count
    input_names: tuple[str, ...]
    input_center: tuple[Finite, ...]
    input_half_range: tuple[Positive, ...]
    output_center_K: Finite
    output_half_range_K: Positive
    layers: tuple[Layer, ...]
    lags: Lags = ()
    domain: Domain = EVERYWHERE
    reach: Annotated[float, Ge(1.0)] = 1.0

    def __post_init__(self) -> None:
        inputs = len(self.input_names)
        if not inputs == len(self.input_center) == len(self.input_half_range):
            raise InputError("input_names, input_center and input_half_range differ in length")
        names = tuple(lag.input_name for lag in self.lags)
        if names and self.input_names[-len(names) :] != names:
            raise InputError(f"input_names: must end in those of the lags, {', '.join(names)}")
        if any(len(direction) != inputs for direction in self.domain.directions):
            raise InputError(f"domain: every direction needs {inputs} components")
        if not self.layers:
            raise InputError("layers: at least one is needed")
        for number, layer in enumerate(self.layers):
            if not layer or any(len(row) != inputs for row in layer):
                raise InputError(f"layers.{number}: every node needs {inputs} edges")
            for edge in (edge for row in layer for edge in row):
                self._check_edge(edge, f"layers.{number}")
            inputs = len(layer)
        if inputs != 1:
            raise InputError("layers: the last one must have one node")

    def _check_edge(self, edge: Edge, where: str) -> None:
        intervals = len(edge.knots) - 1 - 2 * self.degree
        if intervals < 1 or len(edge.coefficients) != intervals + self.degree:
            raise InputError(
                f"{where}: an edge needs G + 1 + 2 degree knots and G + degree coefficients"
            )
        if any(after <= before for before, after in zip(edge.knots, edge.knots[1:])):
            raise InputError(f"{where}: knots must rise strictly")

    @property
    def width(self) -> tuple[int, ...]:
        """Number of nodes of the input and of each layer, such as (4, 1, 1)."""
        return (len(self.input_names), *(len(layer) for layer in self.layers))

    @property
    def edges(self) -> list[Edge]:
        """All edges in the firmware's order: layer by layer, output by output, input by input."""
        return [edge for layer in self.layers for row in layer for edge in row]

    def evaluate(self, inputs: Array) -> tuple[Array, Mask]:
        """Core temperature in K and whether it can be trusted (bool), both (N,).

        `inputs` has shape (N, n_in) in the order of input_names. Not to be trusted are inputs
        outside the box or the domain, and hidden values outside their grid.
        """
        normalised = (inputs - np.asarray(self.input_center)) / np.asarray(self.input_half_range)
        nodes = np.clip(normalised, -self.reach, self.reach)
        in_domain = np.all(np.abs(normalised) <= 1.0, axis=1) & self.domain.contains(normalised)
        for layer in self.layers:
            columns = []
            for row in layer:
                total = np.zeros(len(inputs))
                for source, edge in enumerate(row):
                    phi, inside = edge.evaluate(nodes[:, source], self.degree)
                    total += phi
                    in_domain &= inside
                columns.append(total)
            nodes = np.stack(columns, axis=1)
        return self.output_center_K + self.output_half_range_K * nodes[:, 0], in_domain
