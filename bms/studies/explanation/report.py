"""An explanation as JSON, text and LaTeX."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.studies.explanation.approximation import linear_combination
from bms.studies.explanation.explain import EdgeExplanation, Explanation
from bms.studies.explanation.fitting import RULE
from bms.studies.explanation.symbols import input_symbol, input_unit, node_symbol


@dataclasses.dataclass(frozen=True)
class Subject:
    """What is explained: model file, its hash, its inputs, and where the data come from."""

    model: str
    model_hash: str
    input_names: tuple[str, ...]
    data: str


def as_json(subject: Subject, explanation: Explanation) -> dict[str, Any]:
    """Content of explanation.json; errors in kelvin of the estimate."""
    return {
        **dataclasses.asdict(subject),
        "rule": RULE,
        "edges": [_edge_content(subject, edge) for edge in _edges(explanation)],
        "formula": {
            "steps": dict(explanation.formula.steps),
            "composed": explanation.formula.composed,
            "latex": explanation.formula.latex_composed,
            "rmse_K": explanation.formula_rmse_K,
            "max_abs_error_K": explanation.formula_max_abs_error_K,
        },
        "sensitivity_K_per_unit": {
            one.name: {
                "unit": f"K/{input_unit(one.name) or '1'}",
                "data": _spread(one.data_K),
                "box": _spread(one.box_K),
            }
            for one in explanation.sensitivities
        },
    }


def as_text(subject: Subject, explanation: Explanation) -> str:
    """Content of explanation.txt; its formulas are valid Python."""
    formula = explanation.formula
    lines = [
        f"Model {subject.model} ({subject.model_hash[:8]}), data: {subject.data}",
        "",
        *(f"{input_symbol(name)[0]} = {name}" for name in subject.input_names),
        "",
        f"Edges: {RULE}.",
        "",
    ]
    for edge in _edges(explanation):
        own = _edge_formula(subject, edge, latex=False)
        lines += [
            f"{_edge_name(subject, edge)}: {edge.approximation.form}, {_errors(edge)}",
            f"    {own}",
        ]
    lines += ["", "Formula, core temperature in K:", ""]
    lines += [f"{symbol} = {expression}" for symbol, expression in formula.steps]
    lines += ["", "In one piece:", "", f"Tc = {formula.composed}", ""]
    lines += [_formula_errors(explanation), "", "Sensitivity dTc/dx: least, median, largest", ""]
    for one in explanation.sensitivities:
        lines.append(
            f"{one.name}: data {_spread_text(one.data_K)}, box {_spread_text(one.box_K)} "
            f"K/{input_unit(one.name) or '1'}"
        )
    return "\n".join(lines) + "\n"


def as_latex(subject: Subject, explanation: Explanation) -> str:
    """Content of explanation.tex, a document of its own."""
    lines = [
        r"\documentclass{article}",
        r"\usepackage{amsmath}",
        r"\usepackage[a4paper,margin=2cm]{geometry}",
        r"\begin{document}",
        rf"Model \texttt{{{_escaped(subject.model)}}} ({subject.model_hash[:8]}), "
        rf"data: {_escaped(subject.data)}.",
        "",
        _escaped(f"Edges: {RULE}."),
        r"\begin{itemize}",
    ]
    for edge in _edges(explanation):
        lines += [
            rf"\item {_escaped(edge.approximation.form)}, {_escaped(_errors(edge))}:",
            rf"  ${_edge_formula(subject, edge, latex=True)}$",
        ]
    lines += [r"\end{itemize}", "Formula, core temperature in K:"]
    for symbol, expression in explanation.formula.latex_steps:
        lines += ["", r"\noindent\raggedright", f"${symbol} = {expression}$"]
    lines += ["", _escaped(_formula_errors(explanation)), "", r"\begin{tabular}{lrrrrrrl}"]
    lines.append(r" & \multicolumn{3}{c}{data} & \multicolumn{3}{c}{box} & \\")
    lines.append(r"$\partial \hat T_c/\partial x$" + " & least & median & largest" * 2 + r" & \\")
    for one in explanation.sensitivities:
        cells = [f"{value:.4g}" for part in (one.data_K, one.box_K) for value in _three(part)]
        unit = input_unit(one.name).replace("²", "$^2$") or "1"
        lines.append(f"${input_symbol(one.name)[1]}$ & {' & '.join(cells)} & K/{unit}" + r" \\")
    lines += [r"\end{tabular}", r"\end{document}"]
    return "\n".join(lines) + "\n"


def _edges(explanation: Explanation) -> Iterator[EdgeExplanation]:
    return (edge for layer in explanation.edges for row in layer for edge in row)


def _edge_content(subject: Subject, edge: EdgeExplanation) -> dict[str, Any]:
    return {
        "layer": edge.layer,
        "from": edge.source,
        "to": edge.target,
        **dataclasses.asdict(edge.approximation),
        "text": _edge_formula(subject, edge, latex=False),
        "latex": _edge_formula(subject, edge, latex=True),
        "rmse_K": edge.rmse_K,
        "max_abs_error_K": edge.max_abs_error_K,
        "r_squared": edge.r_squared,
        "data_range": [float(edge.bins[0]), float(edge.bins[-1])],
        "candidates": [
            {
                "form": one.approximation.form,
                "parameters": one.approximation.parameters,
                "rmse_K": one.rmse_K,
                "r_squared": one.r_squared,
            }
            for one in edge.candidates
        ],
    }


def _source_symbol(subject: Subject, edge: EdgeExplanation, *, latex: bool) -> str:
    if edge.layer == 0:
        return input_symbol(subject.input_names[edge.source])[latex]
    return node_symbol(edge.layer, edge.source + 1)[latex]


def _edge_formula(subject: Subject, edge: EdgeExplanation, *, latex: bool) -> str:
    symbol = _source_symbol(subject, edge, latex=latex)
    one = edge.approximation
    return linear_combination(one.offset, one.terms(symbol, latex=latex), latex=latex)


def _edge_name(subject: Subject, edge: EdgeExplanation) -> str:
    symbol = _source_symbol(subject, edge, latex=False)
    return f"layer {edge.layer}, edge {edge.source} -> {edge.target} ({symbol})"


def _errors(edge: EdgeExplanation) -> str:
    return (
        f"RMSE {edge.rmse_K:.2g} K, largest {edge.max_abs_error_K:.2g} K, R2 {edge.r_squared:.6f}"
    )


def _formula_errors(explanation: Explanation) -> str:
    return (
        f"Formula against the network over the data: RMSE {explanation.formula_rmse_K:.2g} K, "
        f"largest {explanation.formula_max_abs_error_K:.2g} K"
    )


def _three(values: Array) -> tuple[float, float, float]:
    return float(values.min()), float(np.median(values)), float(values.max())


def _spread(values: Array) -> dict[str, float]:
    return dict(zip(("min", "median", "max"), _three(values)))


def _spread_text(values: Array) -> str:
    return " ".join(f"{value:.4g}" for value in _three(values))


def _escaped(text: str) -> str:
    return "".join("\\" + letter if letter in "_%#&$" else letter for letter in text)
