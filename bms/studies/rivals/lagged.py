"""Lagged inputs of several models side by side, and how noise in the readings reaches them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from bms.arrays import Array
from bms.data.lags import Lags, at_rest, step
from bms.kan.network import INPUT_NAMES, Network
from bms.studies.rivals.estimator import BASE_COLUMNS


class LagCost(NamedTuple):
    """Constants and state of the filters as float32 numbers, and multiply-adds of a step."""

    floats: int
    multiply_adds: int


def lag_cost(lags: Lags) -> LagCost:
    """A lag has a decay, a gain and its value; the last surface temperature is kept as well."""
    if not lags:
        return LagCost(0, 0)
    squares = any(lag.quantity == "current_squared_A2" for lag in lags)
    return LagCost(3 * len(lags) + 1, 2 * len(lags) + squares)


def all_lags(networks: Iterable[Network]) -> Lags:
    """The lags of all networks, each once."""
    return tuple(dict.fromkeys(lag for network in networks for lag in network.lags))


def columns_of(network: Network, lags: Lags) -> tuple[int, ...]:
    """Where the inputs of a network stand among the four and `lags`."""
    return (*BASE_COLUMNS, *(len(INPUT_NAMES) + lags.index(lag) for lag in network.lags))


def lagged_columns(lags: Lags, inputs: Array, time_s: Array) -> Array:
    """Filter values (N, lags) along one profile with inputs (N, 4 or more), from rest on."""
    columns = np.empty((len(inputs), len(lags)))
    values = at_rest(lags, 1)
    columns[0] = values[:, 0]
    for row in range(1, len(inputs) if lags else 0):
        before, after = inputs[row - 1], inputs[row]
        values = step(
            lags, values, time_s[row] - time_s[row - 1], before[0:1], after[2:3] - before[2:3]
        )
        columns[row] = values[:, 0]
    return columns
