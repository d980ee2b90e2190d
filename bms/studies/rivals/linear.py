"""Linear and quadratic least squares on the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from bms.arrays import Array
from bms.data.lags import Lags
from bms.data.simulate import Samples
from bms.studies.rivals._rivals import ffi, lib
from bms.studies.rivals.estimator import FLOAT32_BYTES, Cost, Rows, Starts
from bms.studies.rivals.lagged import lag_cost
from bms.studies.rivals.native_array import filled, float_array, pointer

_Factors = list[tuple[int, ...]]


class _LeastSquares:
    """offset + sum of weights times products of x - center, fitted to samples by least squares."""

    given = "training data"
    _structure: ClassVar[str]
    _estimate_rows: ClassVar[Any]

    def __init__(self, name: str, training: Samples, columns: Sequence[int], lags: Lags) -> None:
        """`lags` are the filters behind the columns after the first four."""
        self.name, self.columns = name, tuple(columns)
        inputs = training.inputs[:, list(self.columns)]
        center, spread = inputs.mean(axis=0), self._spread(inputs)
        factors = self._factors(len(self.columns))
        scaled = (inputs - center) / spread
        products = [scaled[:, list(factor)].prod(axis=1) for factor in factors]
        terms = np.column_stack([*products, np.ones(len(inputs))])
        # The smallest weights where a channel does not vary, such as no cooling.
        solution = np.linalg.lstsq(terms, training.core_temperature_K, rcond=None)[0]
        weights_K = solution[:-1] / [spread[list(factor)].prod() for factor in factors]
        filters = lag_cost(lags)
        self.cost = Cost(
            len(factors) + 1,
            FLOAT32_BYTES * (len(center) + len(factors) + 1 + filters.floats),
            len(factors) + filters.multiply_adds,
        )
        self._tables = (float_array(center), float_array(weights_K))
        self._map = ffi.new(
            self._structure,
            {
                "inputs": len(center),
                "center": self._tables[0],
                "weights_K": self._tables[1],
                "offset_K": solution[-1],
            },
        )

    @staticmethod
    def _factors(count: int) -> _Factors:
        """Inputs of each product, in the order of the weights in C."""
        raise NotImplementedError

    @staticmethod
    def _spread(inputs: Array) -> Array:
        """What inputs are divided by for the fit."""
        return np.ones(inputs.shape[1])

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return filled(
            lambda core_K: self._estimate_rows(self._map, pointer(inputs), len(inputs), core_K),
            len(inputs),
        )


class LinearEstimator(_LeastSquares):
    """One weight for each input."""

    _structure = "linear_t *"
    _estimate_rows = lib.linear_rows

    @staticmethod
    def _factors(count: int) -> _Factors:
        return [(i,) for i in range(count)]


class QuadraticEstimator(_LeastSquares):
    """One weight for each input and for each product of two."""

    _structure = "quadratic_t *"
    _estimate_rows = lib.quadratic_rows

    @staticmethod
    def _factors(count: int) -> _Factors:
        return [
            factor for i in range(count) for factor in ((i,), *((i, j) for j in range(i, count)))
        ]

    @staticmethod
    def _spread(inputs: Array) -> Array:
        # Squares of kelvin and of watt are too far apart to be fitted together.
        varies = np.ptp(inputs, axis=0) > 0.0
        spread: Array = np.where(varies, inputs.std(axis=0), 1.0)
        return spread
