"""Linear and quadratic least squares on the inputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bms.arrays import Array
from bms.data.lags import Lags
from bms.data.simulate import Samples
from bms.studies.rivals._rivals import ffi, lib
from bms.studies.rivals.estimator import FLOAT32_BYTES, Cost, Rows, Starts
from bms.studies.rivals.lagged import lag_cost
from bms.studies.rivals.native_array import filled, float_array, pointer


class LinearEstimator:
    """offset + sum of weights (x - center), fitted to samples by least squares."""

    given = "training data"

    def __init__(self, name: str, training: Samples, columns: Sequence[int], lags: Lags) -> None:
        """`lags` are the filters behind the columns after the first four."""
        self.name, self.columns = name, tuple(columns)
        inputs = training.inputs[:, list(self.columns)]
        center = inputs.mean(axis=0)
        terms = np.hstack([inputs - center, np.ones((len(inputs), 1))])
        # The smallest weights where a channel does not vary, such as no cooling.
        solution = np.linalg.lstsq(terms, training.core_temperature_K, rcond=None)[0]
        count = len(self.columns)
        filters = lag_cost(lags)
        self.cost = Cost(
            count + 1,
            FLOAT32_BYTES * (2 * count + 1 + filters.floats),
            count + filters.multiply_adds,
        )
        self._tables = (float_array(center), float_array(solution[:-1]))
        self._linear = ffi.new(
            "linear_t *",
            {
                "inputs": count,
                "center": self._tables[0],
                "weights_K": self._tables[1],
                "offset_K": solution[-1],
            },
        )

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return filled(
            lambda core_K: lib.linear_rows(self._linear, pointer(inputs), len(inputs), core_K),
            len(inputs),
        )


class QuadraticEstimator:
    """offset + sum of weights d + sum of weights d e for all d, e of x - center, least squares."""

    given = "training data"

    def __init__(self, name: str, training: Samples, columns: Sequence[int], lags: Lags) -> None:
        """`lags` are the filters behind the columns after the first four."""
        self.name, self.columns = name, tuple(columns)
        inputs = training.inputs[:, list(self.columns)]
        center = inputs.mean(axis=0)
        # A channel that does not vary has no weight anyway.
        spread = np.where(np.ptp(inputs, axis=0) > 0.0, inputs.std(axis=0), 1.0)
        count = len(self.columns)
        factors = [
            factor for i in range(count) for factor in ((i,), *((i, j) for j in range(i, count)))
        ]
        scaled = (inputs - center) / spread
        terms = np.column_stack(
            [*(scaled[:, list(factor)].prod(axis=1) for factor in factors), np.ones(len(inputs))]
        )
        solution = np.linalg.lstsq(terms, training.core_temperature_K, rcond=None)[0]
        weights_K = solution[:-1] / [spread[list(factor)].prod() for factor in factors]
        filters = lag_cost(lags)
        self.cost = Cost(
            len(factors) + 1,
            FLOAT32_BYTES * (count + len(factors) + 1 + filters.floats),
            len(factors) + filters.multiply_adds,
        )
        self._tables = (float_array(center), float_array(weights_K))
        self._quadratic = ffi.new(
            "quadratic_t *",
            {
                "inputs": count,
                "center": self._tables[0],
                "weights_K": self._tables[1],
                "offset_K": solution[-1],
            },
        )

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return filled(
            lambda core_K: lib.quadratic_rows(
                self._quadratic, pointer(inputs), len(inputs), core_K
            ),
            len(inputs),
        )
