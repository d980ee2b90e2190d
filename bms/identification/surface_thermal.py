"""Heat capacity, cooling and dU/dT of a cell whose core was not measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from bms.arrays import Array
from bms.identification.pieces import bends, hats

ENTROPY_SOC = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
_ENTROPIC_PRIOR_V_PER_K = 1e-4
"""Size of dU/dT of lithium-ion cells: the fit holds it to zero with this error."""
_ENTROPIC_BEND_V_PER_K = 1e-4
_SENSOR_K = 1.0
_BLOCKS_PER_RECORD = 12


@dataclass(frozen=True)
class ThermalRecord:
    """What the fit needs of one recording, arrays (N,), with the heat without the reversible."""

    name: str
    time_s: Array
    current_A: Array
    soc: Array
    surface_K: Array
    ambient_K: Array
    irreversible_W: Array


@dataclass(frozen=True)
class ThermalFit:
    """Thermal part: two masses of which the core's resistance was given, and dU/dT.

    `error` holds the relative standard errors of heat capacity and surface resistance, `entropic_
    error_V_per_K` that of dU/dT. `is_entropy_fitted` is false where it was given or is not told.
    """

    core_resistance_K_per_W: float
    core_heat_capacity_J_per_K: float
    surface_resistance_K_per_W: float
    surface_heat_capacity_J_per_K: float
    entropic_V_per_K: Array
    capacity_error: float
    resistance_error: float
    entropic_error_V_per_K: float
    rmse_K: tuple[float, ...]


def heat_W(record: ThermalRecord, entropic_V_per_K: Array) -> Array:
    """Heat (N,) in the core: measured irreversible, and reversible at the surface's temperature."""
    coefficient = np.interp(record.soc, ENTROPY_SOC, entropic_V_per_K)
    return np.asarray(record.irreversible_W - coefficient * record.surface_K * record.current_A)


def temperatures_K(fit: ThermalFit, record: ThermalRecord, heat: Array) -> tuple[Array, Array]:
    """Core and surface (N,) by the fit, see two_masses_K."""
    return two_masses_K(
        fit.core_resistance_K_per_W,
        fit.core_heat_capacity_J_per_K,
        fit.surface_resistance_K_per_W,
        fit.surface_heat_capacity_J_per_K,
        record,
        heat,
    )


def two_masses_K(
    core_resistance_K_per_W: float,
    core_heat_capacity_J_per_K: float,
    surface_resistance_K_per_W: float,
    surface_heat_capacity_J_per_K: float,
    record: ThermalRecord,
    heat: Array,
) -> tuple[Array, Array]:
    """Core and surface (N,) from the first measured surface, with core as warm as it.

    A row's heat (W) and ambient ended at the row, as the recording's current did.
    """
    core, surface = _response(
        core_resistance_K_per_W,
        core_heat_capacity_J_per_K,
        surface_resistance_K_per_W,
        surface_heat_capacity_J_per_K,
        record.time_s,
        heat[:, None],
        record.ambient_K,
        float(record.surface_K[0]),
    )
    return core[:, 0], surface[:, 0]


def fit_thermal(
    records: Sequence[ThermalRecord],
    core_resistance_K_per_W: float,
    surface_share: float,
    start_J_per_K: float,
    given_entropic_V_per_K: Array | None = None,
) -> ThermalFit:
    """Fit heat capacity, resistance to the ambient and dU/dT to the surface's temperature.

    Linear in dU/dT, whose values are held to zero by 1e-4 V/K and are eliminated in each step.
    """
    noise_K = _SENSOR_K

    def parts(values: Array) -> tuple[Array, Array, Array]:
        total, outer = math.exp(values[0]), math.exp(values[1])
        rows, left = [], []
        for record in records:
            pieces = hats(ENTROPY_SOC, record.soc)
            drive = np.column_stack(
                [
                    record.irreversible_W,
                    -(record.current_A * record.surface_K)[:, None] * pieces,
                ]
            )
            _, surface = _response(
                core_resistance_K_per_W,
                (1.0 - surface_share) * total,
                outer,
                surface_share * total,
                record.time_s,
                drive,
                record.ambient_K,
                float(record.surface_K[0]),
            )
            weight = 1.0 / (noise_K * math.sqrt(len(record.time_s) / 300.0))
            rows.append(surface[:, 1:] * weight)
            left.append((record.surface_K - surface[:, 0]) * weight)
        columns, missing = np.concatenate(rows), np.concatenate(left)
        if given_entropic_V_per_K is not None:
            entropic = given_entropic_V_per_K
        else:
            prior = np.eye(len(ENTROPY_SOC)) / _ENTROPIC_PRIOR_V_PER_K
            smooth = bends(ENTROPY_SOC) / _ENTROPIC_BEND_V_PER_K
            columns = np.concatenate([columns, prior, smooth])
            missing = np.concatenate([missing, np.zeros(len(prior) + len(smooth))])
            entropic = np.asarray(
                np.linalg.lstsq(columns, missing, rcond=None)[0], dtype=np.float64
            )
        return entropic, missing - columns @ entropic, columns

    start = np.array([math.log(start_J_per_K), math.log(5.0 * 60.0 / start_J_per_K)])
    fit = least_squares(
        lambda values: parts(values)[1],
        start,
        bounds=(start - math.log(30.0), start + math.log(30.0)),
        x_scale=0.2,
    )
    entropic, residuals, columns = parts(fit.x)
    spread = _errors(fit.jac, residuals, len(records))
    total, outer = math.exp(fit.x[0]), math.exp(fit.x[1])
    found = ThermalFit(
        core_resistance_K_per_W,
        (1.0 - surface_share) * total,
        outer,
        surface_share * total,
        entropic,
        spread[0],
        spread[1],
        _entropic_error_V_per_K(columns, residuals),
        (),
    )
    rmse_K = tuple(
        float(
            np.sqrt(np.mean((temperatures_K(found, r, heat_W(r, entropic))[1] - r.surface_K) ** 2))
        )
        for r in records
    )
    return replace(found, rmse_K=rmse_K)


def _errors(jacobian: Array, residuals: Array, records: int) -> tuple[float, float]:
    """Relative standard errors, with residuals that hold together over a twelfth of a recording."""
    freedom = max(_BLOCKS_PER_RECORD * records - 2, 1)
    covariance = np.linalg.inv(jacobian.T @ jacobian + 1e-9 * np.eye(2))
    variance = float(residuals @ residuals) / freedom
    first, second = np.sqrt(np.diag(covariance) * variance)
    return float(first), float(second)


def _entropic_error_V_per_K(columns: Array, residuals: Array) -> float:
    covariance = np.linalg.pinv(columns.T @ columns)
    variance = max(1.0, float(residuals @ residuals) / max(len(residuals) / 25.0, 1.0))
    return float(np.sqrt(np.mean(np.diag(covariance)) * variance))


def _response(
    inner_K_per_W: float,
    core_J_per_K: float,
    outer_K_per_W: float,
    surface_J_per_K: float,
    time_s: Array,
    drive_W: Array,
    ambient_K: Array,
    start_K: float,
) -> tuple[Array, Array]:
    """Core and surface (N, D): of the first heat with ambient and start, of the others alone.

    Exact for heat and ambient constant between two rows, by the two modes of the two masses.
    """
    inner, outer = 1.0 / inner_K_per_W, 1.0 / outer_K_per_W
    matrix = np.array(
        [
            [-inner / core_J_per_K, inner / core_J_per_K],
            [inner / surface_J_per_K, -(inner + outer) / surface_J_per_K],
        ]
    )
    rates, modes = np.linalg.eig(matrix)
    inverse = np.linalg.inv(modes)
    columns = drive_W.shape[1]
    # Sources in modes: heat in the core; the ambient, above the start, in the first column.
    heat = inverse[:, 0, None, None] * drive_W[None] / core_J_per_K
    ambient = outer / surface_J_per_K * (ambient_K - start_K)
    heat[:, :, 0] += inverse[:, 1, None] * ambient[None]
    decay = np.exp(rates[:, None] * np.diff(time_s)[None])
    gain = (decay - 1.0) / rates[:, None]
    states = np.zeros((2, len(time_s), columns))
    for mode in range(2):
        pushed = gain[mode][:, None] * heat[mode][1:]
        now = np.zeros(columns)
        for row, (share, push) in enumerate(zip(decay[mode], pushed), start=1):
            now = share * now + push
            states[mode, row] = now
    core = modes[0, 0] * states[0] + modes[0, 1] * states[1]
    surface = modes[1, 0] * states[0] + modes[1, 1] * states[1]
    core[:, 0] += start_K
    surface[:, 0] += start_K
    return core, surface
