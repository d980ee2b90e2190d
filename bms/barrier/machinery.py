"""Robust high-order control barrier conditions, derived from a model in symbols.

For x' = f + g1 u + g2 u^2 + g3 Qc + nu(t) and a barrier B(x) the paper's theorem asks

    L_f^r B + L_g L_f^(r-1) B U + Delta_r >= -K_alpha eta,   eta = (B, B', ..., B^(r-1))

with r the relative degree and Delta_r = sum over k of L_nu^(k) L_f^(r-1-k) B. Nothing here knows of
batteries; bms/barrier/derivation.py applies it to the cell. Needs sympy, which the firmware and the
simulator do not: it is the optional dependency "theory".
"""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.errors import InputError

LARGEST_DEGREE = 6


def require_sympy() -> Any:
    """The sympy module; InputError with the remedy when it is not installed."""
    try:
        return importlib.import_module("sympy")
    except ImportError:
        raise InputError(
            "symbolic derivation: sympy is not installed; run pip install 'kan-rcbf-bms[theory]'"
        ) from None


@dataclass(frozen=True)
class AffineModel:
    """x' = drift + sum of columns times input functions + disturbance, all sympy expressions.

    `inputs` maps a name such as "u^2" to its input function and `columns` to its vector field.
    `disturbance` has one symbol for each state, zero where a state has none.
    """

    states: tuple[Any, ...]
    drift: tuple[Any, ...]
    inputs: Mapping[str, Any]
    columns: Mapping[str, tuple[Any, ...]]
    disturbance: tuple[Any, ...]


@dataclass(frozen=True)
class BarrierCondition:
    """The condition of one barrier: `value` >= 0 with every disturbance symbol still in it.

    `drift_derivatives` are B, L_f B, ... L_f^r B; `input_terms` L_g L_f^(r-1) B by input;
    `uncertainty` is Delta_r and `disturbances` the symbols in it with their rates, in order of
    differentiation: disturbances[k] is the k-th derivative of the model's vector.
    """

    relative_degree: int
    drift_derivatives: tuple[Any, ...]
    input_terms: Mapping[str, Any]
    uncertainty: Any
    value: Any
    disturbances: tuple[tuple[Any, ...], ...]

    def worst_case(self, bounds: Mapping[Any, Any]) -> Any:
        """The condition at the worst disturbance: every symbol within plus or minus its bound.

        A symbol without bound is taken as absent. Raises InputError unless the condition is linear
        in the disturbance, for then the worst case is not at the bounds.
        """
        symbols = [symbol for order in self.disturbances for symbol in order if symbol != 0]
        sympy = require_sympy()
        expanded = sympy.expand(self.value)
        nominal = expanded.subs(dict.fromkeys(symbols, 0))
        coefficients = {symbol: sympy.diff(expanded, symbol) for symbol in symbols}
        if any(value.has(*symbols) for value in coefficients.values()):
            raise InputError("barrier condition: not linear in the disturbance; bound it otherwise")
        return nominal - sum(
            sympy.Abs(sympy.factor(value)) * bounds.get(symbol, 0)
            for symbol, value in coefficients.items()
        )


def check_gains(gains: Sequence[float]) -> tuple[float, ...]:
    """Roots lambda_i > 0 of the chain, ascending, for K_alpha = (k_1, ..., k_r).

    s^r + k_r s^(r-1) + ... + k_1 must be Hurwitz, as the theorem says, and must have real roots, as
    it does not: only then is each of psi_(i+1) = psi_i' + lambda_i psi_i itself kept non-negative.
    Raises InputError otherwise. Roots that coincide are accepted.
    """
    roots = np.roots([1.0, *reversed(list(gains))])
    scale = float(np.max(np.abs(roots), initial=0.0))
    if not np.all(roots.real < 0.0):
        raise InputError(f"barrier gains {list(gains)}: not Hurwitz; all must be positive enough")
    if np.any(np.abs(roots.imag) > 1e-6 * scale):
        raise InputError(f"barrier gains {list(gains)}: complex roots; raise the later gains")
    return tuple(sorted(float(-root.real) for root in roots))


def derive_condition(model: AffineModel, barrier: Any, gains: Sequence[Any]) -> BarrierCondition:
    """The robust condition of a barrier B(x) with gains K_alpha = (k_1, ..., k_r).

    Differentiates B along the model until an input appears. Raises InputError when none appears
    within LARGEST_DEGREE derivatives or when the number of gains is not the relative degree.
    """
    sympy = require_sympy()
    orders = [model.disturbance]
    drift_derivatives, derivatives = [barrier], [barrier]
    while len(derivatives) <= LARGEST_DEGREE:
        gradient = [sympy.diff(drift_derivatives[-1], state) for state in model.states]
        terms = {
            name: sympy.expand(_along(gradient, column)) for name, column in model.columns.items()
        }
        orders.append(tuple(_rate(symbol) for symbol in orders[-1]))
        total = _along([sympy.diff(derivatives[-1], state) for state in model.states], model.drift)
        total += _along(
            [sympy.diff(derivatives[-1], state) for state in model.states], model.disturbance
        )
        for order, rates in itertools.pairwise(orders):
            total += sum(
                sympy.diff(derivatives[-1], symbol) * rate
                for symbol, rate in zip(order, rates)
                if symbol != 0
            )
        drift_derivatives.append(sympy.expand(_along(gradient, model.drift)))
        derivatives.append(sympy.expand(total))
        if any(term != 0 for term in terms.values()):
            degree = len(derivatives) - 1
            if len(gains) != degree:
                raise InputError(
                    f"barrier gains: {len(gains)} given, the relative degree is {degree}"
                )
            value = derivatives[-1] + sum(terms[name] * model.inputs[name] for name in terms)
            value += sum(gain * term for gain, term in zip(gains, derivatives))
            return BarrierCondition(
                relative_degree=degree,
                drift_derivatives=tuple(drift_derivatives),
                input_terms=terms,
                uncertainty=sympy.expand(derivatives[-1] - drift_derivatives[-1]),
                value=sympy.expand(value),
                disturbances=tuple(orders[: degree + 1]),
            )
    raise InputError(f"barrier: no input in its first {LARGEST_DEGREE} derivatives")


def estimation_margin(condition: Any, state: Any, error_bound: Any) -> Any:
    """What an error of at most error_bound in one state can take from a condition.

    Raises InputError unless the condition is linear in that state.
    """
    sympy = require_sympy()
    slope = sympy.diff(sympy.expand(condition), state)
    if slope.has(state):
        raise InputError(f"barrier condition: not linear in {state}; bound its error otherwise")
    return sympy.Abs(sympy.factor(slope)) * error_bound


def _along(gradient: Sequence[Any], field: Sequence[Any]) -> Any:
    return sum(slope * component for slope, component in zip(gradient, field))


def _rate(symbol: Any) -> Any:
    return 0 if symbol == 0 else require_sympy().Symbol(f"d{symbol}", real=True)
