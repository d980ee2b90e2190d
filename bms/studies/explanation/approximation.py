"""Elementary functions that stand for an edge, as numbers, as text and as LaTeX."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.kan.basis import silu

DIGITS = 6
OFFSET_DIGITS = 9
"""Significant digits in formulas, of offsets and of all else; errors are those after rounding."""


@dataclass(frozen=True)
class Shape:
    """f of a f(b (x - x0)) + d: as function, text and LaTeX with `z` for its argument."""

    function: Callable[[Array], Array]
    text: str
    latex: str


SHAPES = {
    "sqrt": Shape(np.sqrt, "sqrt({z})", r"\sqrt{{{z}}}"),
    "exp": Shape(np.exp, "exp({z})", r"\exp\left({z}\right)"),
    "log": Shape(np.log, "log({z})", r"\ln\left({z}\right)"),
    "sin": Shape(np.sin, "sin({z})", r"\sin\left({z}\right)"),
    "tanh": Shape(np.tanh, "tanh({z})", r"\tanh\left({z}\right)"),
    "gaussian": Shape(
        lambda z: np.exp(-(z**2)), "exp(-({z})**2)", r"\exp\left(-\left({z}\right)^{{2}}\right)"
    ),
    "silu": Shape(
        silu, "({z})/(1 + exp(-({z})))", r"\frac{{{z}}}{{1 + \exp\left(-\left({z}\right)\right)}}"
    ),
}
POLYNOMIALS = ("constant", "linear", "quadratic", "cubic")


@dataclass(frozen=True)
class Approximation:
    """offset + sum_i factors[i] (x - center)^(i + 1), or offset + factor f(rate (x - center)).

    `form` is one of POLYNOMIALS or of SHAPES; for the latter there is one factor.
    """

    form: str
    center: float
    offset: float
    factors: tuple[float, ...]
    rate: float = 1.0

    def __call__(self, x: Array) -> Array:
        """Value at x of any shape, in physical units on the first layer."""
        return self.offset + self.varying(x)

    def varying(self, x: Array) -> Array:
        """Value without the offset."""
        shifted = np.asarray(x, dtype=np.float64) - self.center
        if self.form in SHAPES:
            varying = self.factors[0] * SHAPES[self.form].function(self.rate * shifted)
        else:
            varying = np.zeros_like(shifted)
            for power, factor in enumerate(self.factors, start=1):
                varying = varying + factor * shifted**power
        return np.asarray(varying)

    @property
    def parameters(self) -> int:
        """How many numbers are free: what `simpler` counts."""
        return len(self.factors) + 1 if self.form in POLYNOMIALS else 3 + (self.form in _SHIFTED)

    def terms(self, symbol: str, *, latex: bool) -> list[tuple[float, str]]:
        """The parts without offset as factor and function of the symbol."""
        shifted = _difference(symbol, self.center, latex=latex)
        if self.form in SHAPES:
            shape = SHAPES[self.form]
            argument = f"{number(self.rate, latex=latex)}{_times(latex)}{shifted}"
            if self.rate == 1.0:
                argument = shifted
            pattern = shape.latex if latex else shape.text
            return [(self.factors[0], pattern.format(z=argument))]
        power = "^{{{}}}" if latex else "**{}"
        return [
            (factor, shifted + (power.format(n) if n > 1 else ""))
            for n, factor in enumerate(self.factors, start=1)
        ]


_SHIFTED = ("sin", "tanh", "gaussian", "silu")
"""Forms whose place along x is free besides rate, factor and offset."""


def rounded(value: float) -> float:
    """The value to the digits that formulas print."""
    return float(f"{value:.{DIGITS}g}")


def number(value: float, *, latex: bool, digits: int = DIGITS) -> str:
    """A number as formulas print it; LaTeX gets powers of ten."""
    text = f"{value:.{digits}g}"
    if latex and "e" in text:
        mantissa, exponent = text.split("e")
        return rf"{mantissa} \times 10^{{{int(exponent)}}}"
    return text


def linear_combination(offset: float, terms: list[tuple[float, str]], *, latex: bool) -> str:
    """offset + factor term + ..., with signs between the terms."""
    text = number(offset, latex=latex, digits=OFFSET_DIGITS)
    for factor, term in terms:
        sign = "-" if factor < 0.0 else "+"
        text += f" {sign} {number(abs(factor), latex=latex)}{_times(latex)}{term}"
    return text


def _difference(symbol: str, center: float, *, latex: bool) -> str:
    left, right = (r"\left(", r"\right)") if latex else ("(", ")")
    if center == 0.0:
        return symbol if symbol.isidentifier() or latex else f"({symbol})"
    sign = "+" if center < 0.0 else "-"
    return f"{left}{symbol} {sign} {number(abs(center), latex=latex)}{right}"


def _times(latex: bool) -> str:
    return r"\," if latex else "*"
