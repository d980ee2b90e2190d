"""Functions of one variable as BPX files have them: a number, an expression in x, or a table."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from bms.arrays import Array

_CALLS: Mapping[str, Callable[[Array], Array]] = {"exp": np.exp, "tanh": np.tanh, "cosh": np.cosh}
"""Those that the standard has; no other name is ever called."""
_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}


def values(function: object, x: Array) -> Array:
    """Values at x of a number, an expression such as "0.1 * exp(-3 * x)", or {"x": ..., "y": ...}.

    A table is linear between its points and constant beyond. ValueError says what is wrong with a
    function, also where any part of it is no finite number.
    """
    with np.errstate(all="ignore"):
        if isinstance(function, str):
            return _of_text(function, x)
        if isinstance(function, Mapping):
            return _of_table(function, x)
        if isinstance(function, (int, float)) and not isinstance(function, bool):
            return _finite(np.full_like(x, float(function)))
    raise ValueError("is neither a number, nor an expression in x, nor a table of x and y")


def _of_text(text: str, x: Array) -> Array:
    try:
        return _of_node(ast.parse(text.strip(), mode="eval").body, x)
    except (SyntaxError, RecursionError, MemoryError, OverflowError):
        raise ValueError("is no expression in x") from None


def _of_node(node: ast.AST, x: Array) -> Array:
    if (
        isinstance(node, ast.Constant)
        and isinstance(node.value, (int, float))
        and not isinstance(node.value, bool)
    ):
        value = np.full_like(x, float(node.value))
    elif isinstance(node, ast.Name) and node.id == "x":
        value = x
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        value = _OPERATORS[type(node.op)](_of_node(node.left, x), _of_node(node.right, x))
    elif isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
        value = _OPERATORS[type(node.op)](_of_node(node.operand, x))
    elif (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in _CALLS
        and len(node.args) == 1
        and not node.keywords
    ):
        value = _CALLS[node.func.id](_of_node(node.args[0], x))
    else:
        raise ValueError(f"has what is no number, x, + - * / ** nor {', '.join(_CALLS)}")
    return _finite(value)


def _of_table(table: Mapping[str, Any], x: Array) -> Array:
    try:
        at, value = np.asarray(table["x"], float), np.asarray(table["y"], float)
    except (KeyError, TypeError, ValueError):
        raise ValueError("is no table of numbers x and y") from None
    if at.ndim != 1 or at.shape != value.shape or at.size < 2 or not np.all(np.diff(at) > 0.0):
        raise ValueError("needs a table whose x rise, with a y for each, two at least")
    return _finite(np.interp(x, at, _finite(value)))


def _finite(value: Array) -> Array:
    if not np.all(np.isfinite(value)):
        raise ValueError("is not finite at every stoichiometry that it is needed at")
    return value
