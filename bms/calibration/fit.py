"""Search for cell parameters with which both closed loops show the paper's figures."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import differential_evolution, least_squares

from bms.calibration.closed_loop import (
    Charge,
    Start,
    charge_with_robust_barriers,
    charge_with_surface_barrier,
)
from bms.calibration.figures import FIGURES
from bms.cell import CellParameters
from bms.presets import Preset
from bms.presets.schema import Initial

Array = npt.NDArray[np.float64]

CORE_TIME_CONSTANT_S = 1.0 / 0.0246
"""Rc Cc in s: the paper's alpha2 = A1 = 0.0246 1/s."""

SEARCH_PERIOD_S, POLISH_PERIOD_S, FINAL_PERIOD_S = 1.0, 0.2, 0.1
_POPULATION_PER_PARAMETER = 15
_POLISH_STEP = 2e-3
_MISFIT_CAP = 100.0
_LEAST_CURRENT_A, _CURRENT_TOLERANCE_A = 2.0, 0.5


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
    FreeParameter("surface_heat_capacity_J_per_K", 1.0, 8.0, True, "published 4.5"),
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


def both_charges(
    preset: Preset, cell: CellParameters, start: Start, error_bound_K: float, period_s: float
) -> tuple[Charge, Charge]:
    """Charges with KAN-rCBF and with S-CBF."""
    return (
        charge_with_robust_barriers(cell, preset, start, error_bound_K, period_s),
        charge_with_surface_barrier(cell, preset, start, period_s),
    )


def rounded_preset(preset: Preset, values: Array) -> Preset:
    """The preset with fitted values of shape (9,): the cell to 5 digits, the start to 4 decimals."""
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


def fit(
    preset: Preset,
    error_bound_K: float,
    seed: int,
    generations: int,
    on_generation: Progress,
) -> Array:
    """Values of FREE_PARAMETERS with the least misfit, of shape (9,).

    Differential evolution over the whole ranges, then least squares from its best. The misfit is
    the sum of squared differences in units of each figure's tolerance; a charge that pauses counts
    as a misfit too, because the paper's never does.
    """
    logarithmic = np.array([parameter.logarithmic for parameter in FREE_PARAMETERS])
    bounds = np.array([(parameter.low, parameter.high) for parameter in FREE_PARAMETERS])
    bounds[logarithmic] = np.log(bounds[logarithmic])
    low, span = bounds[:, 0], bounds[:, 1] - bounds[:, 0]

    def values(shares: Array) -> Array:
        """From the unit cube (9, N) to parameters."""
        scaled = low[:, None] + span[:, None] * shares
        return np.where(logarithmic[:, None], np.exp(scaled), scaled)

    def differences(shares: Array, period_s: float) -> Array:
        cell, start = candidates(preset.cell, values(shares))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            robust, surface = both_charges(preset, cell, start, error_bound_K, period_s)
        least_A = np.minimum(robust.smallest_current_A, surface.smallest_current_A)
        pause = np.maximum(_LEAST_CURRENT_A - least_A, 0.0) / _CURRENT_TOLERANCE_A
        misfits = [
            (ours - figure.paper) / figure.tolerance
            for figure, ours in zip(FIGURES, figures_of(robust, surface))
        ]
        return np.clip(np.nan_to_num([*misfits, pause], nan=np.inf), -_MISFIT_CAP, _MISFIT_CAP)

    generation = 0

    def report(intermediate_result: Any) -> None:
        nonlocal generation
        generation += 1
        on_generation(generation, float(intermediate_result.fun))

    found = differential_evolution(
        lambda shares: np.sum(differences(shares, SEARCH_PERIOD_S) ** 2, axis=0),
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

    def jacobian(share: Array) -> Array:
        step = _POLISH_STEP * np.eye(len(share))
        above = np.clip(share[:, None] + step, 0.0, 1.0)
        below = np.clip(share[:, None] - step, 0.0, 1.0)
        change = differences(np.hstack([above, below]), POLISH_PERIOD_S)
        width = np.diagonal(above - below)
        return (change[:, : len(share)] - change[:, len(share) :]) / width

    polished = least_squares(
        lambda share: differences(share[:, None], POLISH_PERIOD_S)[:, 0],
        found.x,
        jac=jacobian,
        bounds=(0.0, 1.0),
        max_nfev=15,
    )
    return values(polished.x[:, None])[:, 0]
