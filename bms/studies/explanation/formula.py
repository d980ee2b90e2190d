"""The formula of the whole network that its approximated edges make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.studies.explanation.approximation import OFFSET_DIGITS, Approximation, linear_combination
from bms.studies.explanation.symbols import input_symbol, node_symbol

_CORE = ("Tc", r"\hat T_c")
Grid = Sequence[Sequence[Sequence[Approximation]]]
"""Approximations as [layer][out][in]; those of the last layer are in kelvin."""


@dataclass(frozen=True)
class Formula:
    """Steps from inputs to the core temperature in K, each a symbol and what it equals."""

    steps: tuple[tuple[str, str], ...]
    latex_steps: tuple[tuple[str, str], ...]
    composed: str
    latex_composed: str


def formula(input_names: Sequence[str], approximations: Grid, output_center_K: float) -> Formula:
    """Formula in physical units; roots, logarithms and the others hold over the data's range."""
    steps, composed = _steps(input_names, approximations, output_center_K, latex=False)
    latex_steps, latex_composed = _steps(input_names, approximations, output_center_K, latex=True)
    return Formula(steps, latex_steps, composed, latex_composed)


def evaluate(inputs: Array, approximations: Grid, output_center_K: float) -> Array:
    """Core temperature in K (N,) by the formula, for inputs (N, n_in)."""
    nodes = inputs
    for number, layer in enumerate(approximations):
        last = number == len(approximations) - 1
        columns = [
            _offset(row, output_center_K if last else 0.0)
            + np.sum([one.varying(x) for one, x in zip(row, nodes.T)], axis=0)
            for row in layer
        ]
        nodes = np.stack(columns, axis=1)
    return nodes[:, 0]


def _steps(
    input_names: Sequence[str], approximations: Grid, output_center_K: float, *, latex: bool
) -> tuple[tuple[tuple[str, str], ...], str]:
    symbols = [input_symbol(name)[latex] for name in input_names]
    expressions: Mapping[str, str] = {symbol: symbol for symbol in symbols}
    steps = []
    for number, layer in enumerate(approximations, start=1):
        last = number == len(approximations)
        following = {}
        for node, row in enumerate(layer, start=1):
            symbol = _CORE[latex] if last else node_symbol(number, node)[latex]
            offset = _offset(row, output_center_K if last else 0.0)
            steps.append((symbol, _sum(row, offset, symbols, latex=latex)))
            inner = [expressions[symbol] for symbol in symbols]
            if number > 1:
                inner = [_bracketed(text, latex=latex) for text in inner]
            following[symbol] = _sum(row, offset, inner, latex=latex)
        symbols, expressions = list(following), following
    return tuple(steps), expressions[_CORE[latex]]


def _sum(
    row: Sequence[Approximation], offset: float, symbols: Sequence[str], *, latex: bool
) -> str:
    terms = [term for one, s in zip(row, symbols) for term in one.terms(s, latex=latex)]
    return linear_combination(offset, terms, latex=latex)


def _bracketed(text: str, *, latex: bool) -> str:
    return rf"\left[{text}\right]" if latex else f"({text})"


def _offset(row: Sequence[Approximation], further: float) -> float:
    """Sum of the offsets, to the digits that are printed."""
    return float(f"{further + sum(one.offset for one in row):.{OFFSET_DIGITS}g}")
