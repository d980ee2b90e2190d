"""Search for cell parameters with which both closed loops show the paper's figures."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution, least_squares

from bms.arrays import Array
from bms.cell import CellParameters
from bms.presets import Preset
from bms.presets.paper_form import in_paper_form
from bms.presets.schema import Initial
from bms.studies.paper_fit.closed_loop import (
    Charge,
    Start,
    charge_with_robust_barriers,
    charge_with_surface_barrier,
)
from bms.studies.paper_fit.figures import FIGURES

CORE_TIME_CONSTANT_S = 1.0 / 0.0246
"""Rc Cc in s: the paper's alpha2 = A1 = 0.0246 1/s."""

ERROR_RATE_K_PER_S = 0.25
"""Error bound of a trained estimator per Rc Cs: what a step to the full current shows it too late.

Seen on eight trained candidates, 0.10 to 0.26; `--error-bound` replaces it by one bound for all.
"""

SEARCH_PERIOD_S, POLISH_PERIOD_S, FINAL_PERIOD_S = 0.5, 0.2, 0.1
_POPULATION_PER_PARAMETER = 15
_POLISH_STEP = 2e-3
POLISH_EVALUATIONS = 15
_MISFIT_CAP = 100.0
_REGROWTH_TOLERANCE_A, _ERROR_TOLERANCE_K = 0.5, 0.5


@dataclasses.dataclass(frozen=True)
class FreeParameter:
    """A parameter of the fit with the range in which a value means something physically."""

    name: str
    low: float
    high: float
    logarithmic: bool
    range_source: str


FREE_PARAMETERS = (
    FreeParameter("core_resistance_K_per_W", 0.4, 4.0, True, "published 1.94"),
    FreeParameter("surface_resistance_K_per_W", 0.1, 20.0, True, "still air 3.1 to liquid 0.3"),
    FreeParameter("surface_heat_capacity_J_per_K", 0.5, 8.0, True, "published 4.5"),
    FreeParameter("coolant_heat_capacity_J_per_K", 2.0, 500.0, True, "never published"),
    FreeParameter("ohmic_resistance_ohm", 9.95e-3, 24.1e-3, True, "published over 5..45 degC"),
    FreeParameter("entropic_coefficient_V_per_K", -4.65e-4, 4.65e-4, False, "published over SoC"),
    FreeParameter("temperature_K", 278.15, 308.15, False, "5..35 degC"),
    FreeParameter("soc", 0.0, 0.2, False, "nearly empty"),
    FreeParameter("cooling_power_W", 0.0, 5.0, False, "one cell's share"),
)

Progress = Callable[[int, float], None]


def candidates(base: CellParameters, values: Any) -> tuple[CellParameters, Start]:
    """Cells and starts for values in the order of FREE_PARAMETERS, of shape (9,) or (9, N)."""
    given = dict(zip((parameter.name for parameter in FREE_PARAMETERS), values))
    start = Start(*(given.pop(name) for name in Start._fields))
    core_capacity_J_per_K = CORE_TIME_CONSTANT_S / given["core_resistance_K_per_W"]
    cell = dataclasses.replace(base, **given, core_heat_capacity_J_per_K=core_capacity_J_per_K)
    return cell, start


def expected_error_bound_K(cell: CellParameters) -> Any:
    """Error bound that an estimator trained for the cell will have, in K."""
    return ERROR_RATE_K_PER_S * cell.core_resistance_K_per_W * cell.surface_heat_capacity_J_per_K


def both_charges(
    preset: Preset,
    cell: CellParameters,
    start: Start,
    error_bound_K: float | None,
    period_s: float,
) -> tuple[Charge, Charge]:
    """Charges with KAN-rCBF and with S-CBF by the paper's gains, whatever those of the preset.

    Without an error bound the expected one.
    """
    preset = in_paper_form(preset)
    bound_K = expected_error_bound_K(cell) if error_bound_K is None else error_bound_K
    return (
        charge_with_robust_barriers(cell, preset, start, bound_K, period_s),
        charge_with_surface_barrier(cell, preset, start, period_s),
    )


def rounded_preset(preset: Preset, values: Array) -> Preset:
    """The preset with fitted values (9,): the cell to 5 digits, the start to 4 decimals."""
    cell, start = candidates(preset.cell, [float(f"{value:.5g}") for value in values])
    capacity_J_per_K = float(f"{cell.core_heat_capacity_J_per_K:.6g}")
    return dataclasses.replace(
        preset,
        cell=dataclasses.replace(cell, core_heat_capacity_J_per_K=capacity_J_per_K),
        initial=Initial(*(round(value, 4) for value in start)),
    )


def figures_of(robust: Charge, surface: Charge) -> Array:
    """Our values in the order of FIGURES, of shape (7,) or (7, N)."""
    return np.array(
        [
            robust.core_peak_K,
            robust.surface_peak_K,
            robust.time_s,
            robust.first_derate_s,
            surface.core_peak_K,
            surface.surface_peak_K,
            surface.time_s,
        ]
    )


@dataclasses.dataclass(frozen=True)
class Misfit:
    """How far candidates are from the paper's figures; a candidate is a point of the unit cube.

    The misfit is the sum of fourth powers of the differences in units of each figure's tolerance,
    so that the worst counts most. Two wishes count like figures, because many cells fit: a derated
    current does not grow again, as the paper's does not, and the core can be estimated well.
    """

    preset: Preset
    error_bound_K: float | None

    def values(self, points: Array) -> Array:
        """Parameters of candidates (9, N)."""
        logarithmic = np.array([parameter.logarithmic for parameter in FREE_PARAMETERS])
        bounds = np.array([(parameter.low, parameter.high) for parameter in FREE_PARAMETERS])
        bounds[logarithmic] = np.log(bounds[logarithmic])
        low, span = bounds[:, 0], bounds[:, 1] - bounds[:, 0]
        scaled = low[:, None] + span[:, None] * points
        physical: Array = np.where(logarithmic[:, None], np.exp(scaled), scaled)
        return physical

    def residuals(self, points: Array, period_s: float) -> Array:
        """Signed squares of figures' differences and wishes, (9, N); their squares are summed."""
        cell, start = candidates(self.preset.cell, self.values(points))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            robust, surface = both_charges(self.preset, cell, start, self.error_bound_K, period_s)
        wishes = (
            np.maximum(robust.regrowth_A, surface.regrowth_A) / _REGROWTH_TOLERANCE_A,
            expected_error_bound_K(cell) / _ERROR_TOLERANCE_K,
        )
        differences = [
            (ours - figure.paper) / figure.tolerance
            for figure, ours in zip(FIGURES, figures_of(robust, surface))
        ]
        capped: Array = np.clip(
            np.nan_to_num([*differences, *wishes], nan=_MISFIT_CAP), -_MISFIT_CAP, _MISFIT_CAP
        )
        return capped * np.abs(capped)

    def jacobian(self, point: Array, period_s: float) -> Array:
        """Central differences of the residuals at one candidate (9,), within the unit cube."""
        step = _POLISH_STEP * np.eye(len(point))
        above = np.clip(point[:, None] + step, 0.0, 1.0)
        below = np.clip(point[:, None] - step, 0.0, 1.0)
        change = self.residuals(np.hstack([above, below]), period_s)
        width = np.diagonal(above - below)
        return (change[:, : len(point)] - change[:, len(point) :]) / width


def fit(
    preset: Preset,
    error_bound_K: float | None,
    seed: int,
    generations: int,
    on_generation: Progress,
) -> Array:
    """Values of FREE_PARAMETERS with the least misfit, of shape (9,).

    Differential evolution over the whole ranges, then least squares from its best. `on_generation`
    gets the number of each generation, from 1, and its least misfit.
    """
    misfit = Misfit(preset, error_bound_K)
    point = _polished(misfit, _searched(misfit, seed, generations, on_generation))
    return misfit.values(point[:, None])[:, 0]


def _searched(misfit: Misfit, seed: int, generations: int, on_generation: Progress) -> Array:
    """Best candidate (9,) of differential evolution over the unit cube."""
    generation = count(1)

    def report(intermediate_result: Any) -> None:
        on_generation(next(generation), float(intermediate_result.fun))

    found = differential_evolution(
        lambda points: np.sum(misfit.residuals(points, SEARCH_PERIOD_S) ** 2, axis=0),
        [(0.0, 1.0)] * len(FREE_PARAMETERS),
        vectorized=True,
        updating="deferred",
        init="sobol",
        popsize=_POPULATION_PER_PARAMETER,
        mutation=(0.4, 0.9),
        recombination=0.8,
        maxiter=generations,
        tol=0.0,
        polish=False,
        seed=np.random.default_rng(seed),
        callback=report,
    )
    best: Array = found.x
    return best


def _polished(misfit: Misfit, start: Array) -> Array:
    """Least squares from a candidate (9,), at a shorter period."""
    polished = least_squares(
        lambda point: misfit.residuals(point[:, None], POLISH_PERIOD_S)[:, 0],
        start,
        jac=lambda point: misfit.jacobian(point, POLISH_PERIOD_S),
        bounds=(0.0, 1.0),
        max_nfev=POLISH_EVALUATIONS,
    )
    best: Array = polished.x
    return best
