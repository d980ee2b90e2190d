"""Fit of the two-state thermal model to measured core and surface temperature."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from bms.arrays import Array
from bms.cell import CellParameters
from bms.data.measurements import Measurements
from bms.errors import InputError
from bms.identification.trajectory import thermal_trajectory
from bms.identification.uncertainty import correlation, covariance
from bms.presets import Preset
from bms.progress import Progress, to_nobody

FITTED = (
    "core_resistance_K_per_W",
    "surface_resistance_K_per_W",
    "surface_heat_capacity_J_per_K",
    "ohmic_resistance_ohm",
    "entropic_coefficient_V_per_K",
)
ANCHOR = "core_heat_capacity_J_per_K"
"""Kept: temperatures are the same when heat capacities, conductances and heats all scale alike."""
UNSEEN = "coolant_heat_capacity_J_per_K"
"""Kept: the measured coolant temperature is an input of the fit."""

CORRECTIONS = ("surface_heat_capacity_J_per_K", "entropic_coefficient_V_per_K")
"""May keep the start's value where the temperatures hardly depend on it; the others may not."""

_CORE_RESISTANCE = "core_resistance_K_per_W"
_ENTROPIC = "entropic_coefficient_V_per_K"
_ENTROPIC_UNIT_V_PER_K = 1e-4
_LARGEST_CHANGE = math.log(100.0)
_LARGEST_ENTROPIC = 50.0
_LARGEST_ERROR = 0.5
"""Of a logarithm: a value known to no better than a factor of about 1.6 is not identified."""
_LARGEST_ENTROPIC_ERROR = 4.0
"""Of the entropic coefficient in 1e-4 V/K: half the range of the published values over SoC."""
_STRETCHES = (
    (1.0, 1.0, 1.0),
    (3.0, 1.0, 1.0),
    (1.0, 3.0, 1.0),
    (1.0, 1.0, 0.3),
    (0.4, 0.4, 3.0),
)
"""Starts: factors on core resistance, surface resistance and surface heat capacity."""
_SAME_MINIMUM = 1e-4
_MOST_STEPS = 40
"""A fit that takes more wanders along a direction that the data do not fix."""
_FEWEST_ROWS = 100
_AT_BOUND = 0.99
"""Share of the reach of the search; a fit that ends beyond it was stopped by the bound."""
_KEPT = "kept: not identifiable from these data"


class NotIdentifiedError(InputError):
    """No parameter at all can be identified; `reasons` are by parameter."""

    def __init__(self, reasons: Mapping[str, str]) -> None:
        super().__init__(
            "no parameter can be identified from these data; "
            "record a current that heats the core by some kelvin"
        )
        self.reasons = dict(reasons)


@dataclass(frozen=True)
class ParameterEstimate:
    """One parameter in the unit of its name; `standard_error` is None when it was not fitted."""

    name: str
    value: float
    start: float
    standard_error: float | None
    remark: str


@dataclass(frozen=True)
class Residuals:
    """Root mean square of simulated - measured temperature over some rows, in K."""

    core_rmse_K: float
    surface_rmse_K: float
    rows: int


@dataclass(frozen=True)
class Identification:
    """A cell fitted to a recording: parameters, residuals, and correlations between them.

    `correlation` has the order of `correlated`, the names of the fitted parameters.
    `not_identified` has the reasons, by name, of parameters that the data do not tell though the
    temperatures depend on them; with any, the cell is none to build on.
    """

    cell: CellParameters
    parameters: tuple[ParameterEstimate, ...]
    fitted: Residuals
    held_out: Residuals | None
    correlated: tuple[str, ...]
    correlation: Array
    starts: int
    starts_at_minimum: int
    not_identified: Mapping[str, str]

    @property
    def strongest_correlation(self) -> tuple[str, str, float] | None:
        """The two fitted parameters that depend on each other most; None for a single one."""
        if len(self.correlated) < 2:
            return None
        upper = np.triu(self.correlation, 1)
        one, other = np.unravel_index(int(np.argmax(np.abs(upper))), upper.shape)
        return self.correlated[one], self.correlated[other], float(upper[one, other])


def identify(
    measurements: Measurements,
    start: Preset,
    rows: slice | None = None,
    progress: Progress = to_nobody,
) -> Identification:
    """Thermal parameters of the cell from measured core and surface temperature.

    Least squares on the trajectory simulated from the first of `rows` (a slice with step 1; None
    means all) with the measured current and coolant temperature; rows after them are held out and
    simulated on. What the data do not identify, or only at the bound of the search, keeps the
    start's value, and the others are fitted anew; `progress` is that of the present fit. InputError
    for fewer than 100 rows to fit, NotIdentifiedError when nothing is left.
    """
    first, stop, _ = (rows or slice(None)).indices(len(measurements.time_s))
    if stop - first < _FEWEST_ROWS:
        raise InputError(
            f"{max(stop - first, 0)} rows to fit; identification needs at least {_FEWEST_ROWS}"
        )
    recording = _rows(measurements, slice(first, stop))
    smallest_noise_K = start.sensors.surface_temperature_K.error_bound
    cell, names = start.cell, list(FITTED)
    remarks = {
        ANCHOR: "kept: temperatures fix ratios only, this one sets the scale",
        UNSEEN: "kept: the measured coolant is an input",
    }
    reasons: dict[str, str] = {}
    if measurements.has_copied_core:
        names.remove(_CORE_RESISTANCE)
        remarks[_CORE_RESISTANCE] = _KEPT
        reasons[_CORE_RESISTANCE] = "core_temperature_K equals surface_temperature_K in every row"
    while names:
        cell, jacobian, residuals_K, agreeing = _fit(start.cell, names, recording, progress)
        matrix = covariance(jacobian, residuals_K, smallest_noise_K)
        errors = np.sqrt(np.diag(matrix))
        # The flat direction of two parameters that only act together shows in both.
        excess = errors / [_limit(name) for name in names]
        reach = np.abs(_values(cell, names) - _values(start.cell, names)) / [
            _reach(name) for name in names
        ]
        worst = int(np.argmax(np.where(reach > _AT_BOUND, np.inf, excess)))
        name = names[worst]
        if reach[worst] > _AT_BOUND:
            reasons[name] = _bound_reason(getattr(cell, name))
        elif excess[worst] <= 1.0:
            break
        elif name not in CORRECTIONS or _effect_K(cell, name, recording) > max(
            float(np.sqrt(np.mean(residuals_K**2))), smallest_noise_K
        ):
            reasons[name] = _open_reason(name, errors[worst])
        remarks[name] = _KEPT
        names.pop(worst)
    else:
        raise NotIdentifiedError(reasons)
    by_name = dict(zip(names, errors))
    return Identification(
        cell,
        tuple(
            ParameterEstimate(
                name,
                getattr(cell, name),
                getattr(start.cell, name),
                _physical_error(name, getattr(cell, name), by_name[name])
                if name in by_name
                else None,
                remarks.get(name, "identified"),
            )
            for name in (*FITTED, ANCHOR, UNSEEN)
        ),
        *_residuals(cell, _rows(measurements, slice(first, None)), stop - first),
        tuple(names),
        correlation(matrix),
        len(_STRETCHES),
        agreeing,
        {name: reasons[name] for name in FITTED if name in reasons},
    )


def _bound_reason(value: float) -> str:
    return (
        f"at the bound of the search ({value:.3g}); "
        "check units, sign of the current and the preset to start from"
    )


def _open_reason(name: str, error: float) -> str:
    width = (
        f"by {error * _ENTROPIC_UNIT_V_PER_K:.1g} V/K"
        if name == _ENTROPIC
        else f"by a factor of {math.exp(min(error, 100.0)):.2g}"
    )
    return f"the data leave it open {width}; record pulses of current with rests between them"


def _effect_K(cell: CellParameters, name: str, recording: Measurements) -> float:
    """Root mean square by which the temperatures move when the parameter does, within its limit."""
    base_K = np.array(thermal_trajectory(cell, recording))
    (value,) = _values(cell, [name])
    return max(
        float(np.sqrt(np.mean((np.array(thermal_trajectory(moved, recording)) - base_K) ** 2)))
        for moved in (_cell(cell, [name], np.array([value + s * _limit(name)])) for s in (-1, 1))
    )


def _fit(
    start: CellParameters, names: Sequence[str], recording: Measurements, progress: Progress
) -> tuple[CellParameters, Array, Array, int]:
    """Best cell of all starts, Jacobian (2, N, P), residuals (2, N), starts that end there."""

    def residuals(values: Array) -> Array:
        core_K, surface_K = thermal_trajectory(_cell(start, names, values), recording)
        return np.concatenate(
            [core_K - recording.core_temperature_K, surface_K - recording.surface_temperature_K]
        )

    center = _values(start, names)
    reach = np.array([_reach(name) for name in names])
    found = []
    for number, stretch in enumerate(_STRETCHES):
        stretched = dataclasses.replace(
            start,
            **{name: getattr(start, name) * s for name, s in zip(FITTED, stretch) if name in names},
        )
        found.append(
            least_squares(
                residuals,
                _values(stretched, names),
                bounds=(center - reach, center + reach),
                x_scale=np.where(np.array(names) == _ENTROPIC, 1.0, 0.3),
                max_nfev=_MOST_STEPS,
            )
        )
        progress((number + 1) / len(_STRETCHES))
    best = min(found, key=lambda fit: float(fit.cost))
    agreeing = sum(bool(fit.cost <= best.cost * (1.0 + _SAME_MINIMUM) + 1e-9) for fit in found)
    shape = (2, len(recording.time_s))
    return (
        _cell(start, names, best.x),
        best.jac.reshape(*shape, len(names)),
        best.fun.reshape(shape),
        agreeing,
    )


def _values(cell: CellParameters, names: Sequence[str]) -> Array:
    """Parameters as fitted: logarithms, so that they stay positive, and E in 1e-4 V/K."""
    return np.array(
        [
            cell.entropic_coefficient_V_per_K / _ENTROPIC_UNIT_V_PER_K
            if name == _ENTROPIC
            else math.log(getattr(cell, name))
            for name in names
        ]
    )


def _cell(start: CellParameters, names: Sequence[str], values: Array) -> CellParameters:
    physical: dict[str, Any] = {
        name: value * _ENTROPIC_UNIT_V_PER_K if name == _ENTROPIC else math.exp(value)
        for name, value in zip(names, values.tolist())
    }
    return dataclasses.replace(start, **physical)


def _reach(name: str) -> float:
    return _LARGEST_ENTROPIC if name == _ENTROPIC else _LARGEST_CHANGE


def _limit(name: str) -> float:
    return _LARGEST_ENTROPIC_ERROR if name == _ENTROPIC else _LARGEST_ERROR


def _physical_error(name: str, value: float, error: float) -> float:
    return float(error * _ENTROPIC_UNIT_V_PER_K if name == _ENTROPIC else error * value)


def _residuals(
    cell: CellParameters, recording: Measurements, fitted_rows: int
) -> tuple[Residuals, Residuals | None]:
    core_K, surface_K = thermal_trajectory(cell, recording)
    core_error_K = core_K - recording.core_temperature_K
    surface_error_K = surface_K - recording.surface_temperature_K

    def over(rows: slice) -> Residuals:
        core, surface = core_error_K[rows], surface_error_K[rows]
        return Residuals(
            float(np.sqrt(np.mean(core**2))), float(np.sqrt(np.mean(surface**2))), len(core)
        )

    held_out = over(slice(fitted_rows, None)) if len(core_K) > fitted_rows else None
    return over(slice(fitted_rows)), held_out


def _rows(recording: Measurements, rows: slice) -> Measurements:
    return Measurements(
        **{
            field.name: getattr(recording, field.name)[rows]
            for field in dataclasses.fields(recording)
        }
    )
