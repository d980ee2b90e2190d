"""A trained network of this project as one of the estimators."""

from __future__ import annotations

from itertools import pairwise

from bms.arrays import Array
from bms.firmware import CompiledNetwork
from bms.kan.network import Network
from bms.model.model_file import KanModel
from bms.studies.rivals.estimator import FLOAT32_BYTES, Cost, Rows, Starts
from bms.studies.rivals.lagged import lag_cost
from bms.tables import network_tables
from bms.tables.network_tables import CELL_COEFFICIENTS


def trained_parameters(network: Network) -> int:
    """Coefficients of all splines, and two weights for each edge."""
    return sum(len(edge.coefficients) + 2 for edge in network.edges)


class KanEstimator:
    """The firmware's network; lagged inputs are filtered by the caller."""

    given = "training data"

    def __init__(self, name: str, model: KanModel, columns: tuple[int, ...]) -> None:
        """Raises InputError when the network exceeds the firmware's maxima."""
        self.name, self.columns = name, columns
        self.cost = _cost(model.network)
        self._compiled = CompiledNetwork(model)

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return self._compiled.evaluate(inputs)[0]


def _cost(network: Network) -> Cost:
    """Of the estimate with its domain check, which the firmware cannot do without."""
    tables = network_tables(network)
    inputs, edges = tables.width[0], sum(a * b for a, b in pairwise(tables.width))
    table_floats = edges * (tables.cells + 1 + tables.cells * CELL_COEFFICIENTS)
    directions = len(network.domain.directions)
    lags = lag_cost(network.lags)
    # Of an edge: Horner's scheme and the middle of the cell.
    return Cost(
        trained_parameters(network),
        FLOAT32_BYTES * (2 * inputs + 3 + table_floats + directions * (inputs + 2) + lags.floats),
        inputs + directions * inputs + edges * CELL_COEFFICIENTS + 1 + lags.multiply_adds,
    )
