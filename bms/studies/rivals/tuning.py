"""Fitting of the filters to the part of a recording whose core temperature they may see."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from bms.arrays import Array, Mask
from bms.cell import CellParameters
from bms.studies.rivals.estimator import Estimator, Sequences
from bms.studies.rivals.filters import ExtendedKalman, SteadyKalman
from bms.studies.rivals.thermal import FilterNoise

_RATES_K_PER_S = tuple(float(rate) for rate in 10.0 ** np.arange(-4.0, -0.9, 0.5))
_DRIFTS_PER_SQRT_S = (1e-4, 1e-3, 3e-3, 1e-2, 3e-2)

_SCALED = (
    "core_resistance_K_per_W",
    "surface_resistance_K_per_W",
    "surface_heat_capacity_J_per_K",
    "ohmic_resistance_ohm",
)
_LARGEST_LOG_CHANGE = 2.0
_ENTROPIC_UNIT_V_PER_K, _LARGEST_ENTROPIC_CHANGE = 1e-4, 20.0
_LOG_RATES = (float(np.log(1e-5)), 0.0)
_SEARCHES, _EVALUATIONS = 3, 3000


@dataclasses.dataclass(frozen=True)
class FittedRows:
    """A recording, the rows to fit, and its sampling period in s."""

    data: Sequences
    rows: Mask
    period_s: float

    def mean_square_K2(self, estimator: Estimator) -> float:
        """Mean square error over the rows to fit."""
        inputs = self.data.of_columns(estimator.columns)
        error_K = estimator.estimate(inputs, self.data.starts) - self.data.core_temperature_K
        return float(np.mean(error_K[self.rows] ** 2))


def tuned_noise(cell: CellParameters, start: FilterNoise, fitted: FittedRows) -> FilterNoise:
    """Noise of the rates and drift of R0 with the smallest error of the core, from a grid."""
    rates = [
        dataclasses.replace(start, core_K_per_s=core, surface_K_per_s=surface)
        for core in _RATES_K_PER_S
        for surface in _RATES_K_PER_S
    ]
    noise = min(
        rates, key=lambda one: fitted.mean_square_K2(SteadyKalman(cell, one, fitted.period_s, ""))
    )
    drifts = [
        dataclasses.replace(noise, resistance_drift_per_sqrt_s=drift)
        for drift in _DRIFTS_PER_SQRT_S
    ]
    return min(
        drifts,
        key=lambda one: fitted.mean_square_K2(ExtendedKalman(cell, one, fitted.period_s, "", 1.0)),
    )


def tuned_filter(
    cell: CellParameters, noise: FilterNoise, fitted: FittedRows
) -> tuple[CellParameters, FilterNoise]:
    """Cell and noise with which the filter has the smallest error of the core.

    As free as the maps that are fitted to the core: parameters may move by a factor of seven and
    need not make sense as a cell. Nelder-Mead from the cell and the noise given.
    """
    start = np.array(
        [0.0] * (len(_SCALED) + 1) + [np.log(noise.core_K_per_s), np.log(noise.surface_K_per_s)]
    )
    bounds = [
        *[(-_LARGEST_LOG_CHANGE, _LARGEST_LOG_CHANGE)] * len(_SCALED),
        (-_LARGEST_ENTROPIC_CHANGE, _LARGEST_ENTROPIC_CHANGE),
        *[_LOG_RATES] * 2,
    ]

    def error_K2(values: Array) -> float:
        return fitted.mean_square_K2(
            SteadyKalman(*_moved(cell, noise, values), fitted.period_s, "")
        )

    return _moved(cell, noise, _descended(error_K2, start, bounds))


def _descended(
    function: Callable[[Array], float], start: Array, bounds: list[tuple[float, float]]
) -> Array:
    values = start
    for _ in range(_SEARCHES):
        # A new simplex finds a way on where the last one has shrunk.
        values = minimize(
            function,
            values,
            method="Nelder-Mead",
            bounds=bounds,
            options={"maxfev": _EVALUATIONS, "xatol": 1e-4, "fatol": 1e-9, "adaptive": True},
        ).x
    return values


def _moved(
    cell: CellParameters, noise: FilterNoise, values: Array
) -> tuple[CellParameters, FilterNoise]:
    factors = np.exp(values[: len(_SCALED)]).tolist()
    entropic, core, surface = values[len(_SCALED) :].tolist()
    parameters = {name: getattr(cell, name) * factor for name, factor in zip(_SCALED, factors)}
    return (
        dataclasses.replace(
            cell,
            **parameters,
            entropic_coefficient_V_per_K=cell.entropic_coefficient_V_per_K
            + _ENTROPIC_UNIT_V_PER_K * entropic,
        ),
        dataclasses.replace(
            noise,
            core_K_per_s=float(np.exp(core)),
            surface_K_per_s=float(np.exp(surface)),
        ),
    )
