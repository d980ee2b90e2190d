"""Kalman filters on the two-state thermal model, run in C."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.cell import CellParameters
from bms.studies.rivals._rivals import ffi, lib
from bms.studies.rivals.estimator import BASE_COLUMNS, FLOAT32_BYTES, Cost, Rows, Starts
from bms.studies.rivals.native_array import filled, pointer
from bms.studies.rivals.thermal import DiscreteCell, FilterNoise

_CELL_PARAMETERS = 6
"""Two resistances, two heat capacities, ohmic resistance, entropic coefficient."""
_CELL_FLOATS = 8
_THERMAL_STATES = 4
_HEAT_AND_MODEL = 2 + 1 + 6


class SteadyKalman:
    """Linear filter with the gain of the steady state."""

    columns = BASE_COLUMNS
    cost = Cost(
        _CELL_PARAMETERS + 3,
        FLOAT32_BYTES * (_CELL_FLOATS + 2 + _THERMAL_STATES),
        _HEAT_AND_MODEL + 2,
    )

    def __init__(
        self,
        cell: CellParameters,
        noise: FilterNoise,
        period_s: float,
        given: str,
        name: str = "Kalman (steady gain)",
    ) -> None:
        discrete = DiscreteCell.of(cell, period_s)
        self.name, self.given = name, given
        self._filter = ffi.new(
            "steady_kalman_t *",
            {"cell": _cell_fields(cell, discrete), "gain": discrete.steady_gain(noise).tolist()},
        )

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return _run(lib.steady_kalman_rows, self._filter, inputs, starts)


class FullKalman:
    """Linear filter that computes its covariance with every sample."""

    name = "Kalman (full covariance)"
    columns = BASE_COLUMNS
    # F P 8, F P F' 6, gain 2, correction of P 3, correction of the state 2
    cost = Cost(
        _CELL_PARAMETERS + 4,
        FLOAT32_BYTES * (_CELL_FLOATS + 3 + 1 + 3 + _THERMAL_STATES + 3),
        _HEAT_AND_MODEL + 8 + 6 + 2 + 3 + 2,
    )

    def __init__(
        self, cell: CellParameters, noise: FilterNoise, period_s: float, given: str
    ) -> None:
        discrete = DiscreteCell.of(cell, period_s)
        self.given = given
        self._filter = ffi.new(
            "kalman_t *",
            {
                "cell": _cell_fields(cell, discrete),
                "noise": _noise_fields(discrete.process_noise(noise), _start(noise), noise),
            },
        )

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return _run(lib.kalman_rows, self._filter, inputs, starts)


class ExtendedKalman:
    """Filter that estimates the ohmic resistance too, from a start that may be off."""

    columns = BASE_COLUMNS
    # slopes 6, F P 18, F P F' 9, gain 3, correction of P 6, correction of the state 3
    cost = Cost(
        _CELL_PARAMETERS + 6,
        FLOAT32_BYTES * (_CELL_FLOATS + 6 + 1 + 6 + _THERMAL_STATES + 6 + 1),
        _HEAT_AND_MODEL + 1 + 6 + 18 + 9 + 3 + 6 + 3,
    )

    def __init__(
        self,
        cell: CellParameters,
        noise: FilterNoise,
        period_s: float,
        given: str,
        start_factor: float,
    ) -> None:
        """`start_factor` is the assumed resistance at the start over the cell's."""
        self.name = f"extended Kalman (R0 from {100.0 * start_factor:.0f} %)"
        self.given = given
        resistance_ohm = start_factor * cell.ohmic_resistance_ohm
        assumed = dataclasses.replace(cell, ohmic_resistance_ohm=resistance_ohm)
        discrete = DiscreteCell.of(assumed, period_s)
        drift = noise.resistance_drift_per_sqrt_s**2 * period_s
        process, start = np.zeros((3, 3)), np.zeros((3, 3))
        process[:2, :2], process[2, 2] = discrete.process_noise(noise), drift
        start[:2, :2], start[2, 2] = _start(noise), noise.resistance_start**2
        self._filter = ffi.new(
            "kalman_t *",
            {
                "cell": _cell_fields(assumed, discrete),
                "noise": _noise_fields(process, start, noise),
            },
        )

    def estimate(self, inputs: Rows, starts: Starts) -> Array:
        """Core temperature in K (N,), by the contract of Estimator."""
        return _run(lib.extended_kalman_rows, self._filter, inputs, starts)


def _start(noise: FilterNoise) -> Array:
    """Both temperatures start at the same reading; the core may be off beyond that."""
    return np.array(
        [
            [noise.reading_K**2 + noise.start_K**2, noise.reading_K**2],
            [noise.reading_K**2, noise.reading_K**2],
        ]
    )


def _cell_fields(cell: CellParameters, discrete: DiscreteCell) -> dict[str, Any]:
    return {
        "transition": discrete.transition.tolist(),
        "heat_gain_K_per_W": discrete.heat_gain_K_per_W.tolist(),
        "ohmic_resistance_ohm": cell.ohmic_resistance_ohm,
        "entropic_coefficient_V_per_K": cell.entropic_coefficient_V_per_K,
    }


def _noise_fields(process: Array, start: Array, noise: FilterNoise) -> dict[str, Any]:
    return {
        "states": len(process),
        "start": start.tolist(),
        "process_noise": process.tolist(),
        "reading_variance": noise.reading_K**2,
    }


def _run(function: Any, kalman: Any, inputs: Rows, starts: Starts) -> Array:
    return filled(
        lambda core_K: function(kalman, pointer(inputs), pointer(starts), len(starts) - 1, core_K),
        len(inputs),
    )
