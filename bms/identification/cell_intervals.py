"""How far a cell may be from the identified one: from residuals and spread, else assumed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.identification.cell_identification import (
    IdentifiedCell,
    electrical_records,
    model_voltage_V,
)
from bms.identification.core_disturbance import CoreDisturbance, core_disturbance
from bms.identification.electrical import rest_offset_V, step_ohm, step_rows
from bms.identification.geometry import SURFACE_SHARE
from bms.identification.rated import RatedLimits

_ONE_WAY_OCV_V = 0.01
_LEAST_OCV_V = 0.003
_LEAST_ENTROPIC_V_PER_K = 5e-5
_SUB_SAMPLE = 0.7
"""Of the resistance of a step seen after 0.2 s or later, which is there at once."""
_AT_ONCE_S = 0.2
_COOLING = (0.5, 2.0)
_UNCERTAINTY_K_PER_S = 5e-4
_LEAST_STEPS = 3


@dataclass(frozen=True)
class CellIntervals:
    """Fields of a preset's interval, uncertainty and noise, with where each comes from."""

    factors: dict[str, Any]
    notes: dict[str, str]
    least_ohm: float
    uncertainty: dict[str, float]
    uncertainty_notes: dict[str, str]
    noise: dict[str, float]
    remarks: tuple[str, ...]

    @property
    def ocv_error_V(self) -> float:
        """Error of the open-circuit voltage."""
        return float(self.factors["ocv_error_V"])

    @property
    def entropic_error_V_per_K(self) -> float:
        """Error of dU/dT."""
        return float(self.factors["entropic_error_V_per_K"])


def cell_intervals(cell: IdentifiedCell, rated: RatedLimits) -> CellIntervals:
    """Intervals that hold what the recordings scatter by, and what nothing tells as assumed."""
    factors: dict[str, Any] = {}
    notes: dict[str, str] = {}
    remarks: list[str] = []
    _thermal(cell, factors, notes)
    least_ohm = _resistance(cell, rated, factors, notes)
    _capacity(cell, rated, factors, notes)
    _open_circuit(cell, factors, notes)
    core = core_disturbance(cell)
    uncertainty, uncertainty_notes = _uncertainty(cell, core)
    if core.remark is not None:
        remarks.append(core.remark)
    if all(np.all(r.current_A > -0.2 * cell.alignment.capacity_Ah) for r in cell.recordings):
        remarks.append(
            "no recording charges with more than C/5: resistances are those of discharge, "
            "their intervals have to cover charge"
        )
    return CellIntervals(
        factors,
        notes,
        least_ohm,
        uncertainty,
        uncertainty_notes,
        _noise(cell),
        tuple(remarks),
    )


def _thermal(cell: IdentifiedCell, factors: dict[str, Any], notes: dict[str, str]) -> None:
    middle, low, high = cell.thermal
    resistance = middle.core_resistance_K_per_W
    factors["core_resistance"] = _around(
        low.core_resistance_K_per_W / resistance, high.core_resistance_K_per_W / resistance
    )
    notes["core_resistance"] = f"assumed, interval of publications: {cell.shape.source}"
    told = "fitted: two standard errors, and the ends of the core resistance"
    spread = 2.0 * middle.capacity_error + 0.05
    others = [
        fit.core_heat_capacity_J_per_K / middle.core_heat_capacity_J_per_K for fit in cell.thermal
    ]
    factors["core_heat_capacity"] = _around(
        min(others) * max(1.0 - spread, 0.5), max(others) * (1.0 + spread)
    )
    outer = [
        fit.surface_resistance_K_per_W / middle.surface_resistance_K_per_W for fit in cell.thermal
    ]
    spread = 2.0 * middle.resistance_error
    factors["surface_resistance"] = _around(
        min(_COOLING[0], min(outer) * max(1.0 - spread, 0.3)),
        max(_COOLING[1], max(outer) * (1.0 + min(spread, 1.5))),
    )
    low_share, share, high_share = SURFACE_SHARE
    factors["surface_heat_capacity"] = _around(low_share / share, high_share / share)
    factors["coolant_heat_capacity"] = (0.5, 2.0)
    error = max(2.0 * middle.entropic_error_V_per_K, _LEAST_ENTROPIC_V_PER_K)
    factors["entropic_error_V_per_K"] = _up(error)
    notes |= {
        "core_heat_capacity": told if cell.is_thermal_fitted else "assumed, interval",
        "surface_resistance": f"{told}, at least half to twice for another mounting"
        if cell.is_thermal_fitted
        else "assumed, interval",
        "surface_heat_capacity": f"assumed, interval: {100 * low_share:.0f} to "
        f"{100 * high_share:.0f} % of the cell's heat capacity",
        "coolant_heat_capacity": "assumed, interval",
        "entropic_error_V_per_K": "fitted: two standard errors"
        if cell.is_thermal_fitted
        else "assumed, interval",
    }


def _resistance(
    cell: IdentifiedCell, rated: RatedLimits, factors: dict[str, Any], notes: dict[str, str]
) -> float:
    """Factors on the ohmic resistance and the branches; returns the least resistance in ohm."""
    alignment, fit = cell.alignment, cell.electrical
    records = electrical_records(cell.recordings, alignment, cell.core_K)
    ratios, periods_s = [], []
    least_ohm = 0.25 * float(np.median(fit.ohm))
    for record in records:
        rows = step_rows(record, alignment.capacity_Ah)
        own = np.maximum(fit.resistance_ohm(record.core_K[rows], record.soc[rows]), least_ohm)
        inside = (record.soc[rows] > 0.05) & (record.soc[rows] < 1.02)
        ratios += (step_ohm(record, alignment.capacity_Ah) / own)[inside].tolist()
        periods_s += np.diff(record.time_s)[rows - 1].tolist()
    life = rated.life_resistance
    if len(ratios) >= _LEAST_STEPS:
        low, high = (float(value) for value in np.quantile(ratios, [0.02, 0.98]))
        steps = f"{len(ratios)} steps of the current are {low:.2f} to {high:.2f} of the table"
    else:
        low, high, steps = 0.7, 1.3, "assumed: too few steps of the current"
    if periods_s and float(np.median(periods_s)) > _AT_ONCE_S:
        low *= _SUB_SAMPLE
        steps += f", 0.7 of it at once (rows are {np.median(periods_s):.2g} s apart)"
    factors["resistance"] = _around(min(low, 1.0), max(high, 1.0) * life)
    notes["resistance"] = (
        f"{steps}; times {life:g} at the end of life ({rated.sources['life_resistance']})"
    )
    factors["polarisation"] = (
        0.0,
        _up(max(_polarisation_factor(cell, records, max(high, 1.0)), 1.0) * life),
    )
    notes["polarisation"] = (
        f"fitted: what covers 99 % of the rows from SoC 0.1 to 0.95; times {life:g}; "
        "none at the least"
    )
    longest_s = max((branch.time_constant_s for branch in fit.branches), default=60.0)
    factors["longest_relaxation_s"] = min(3600.0, _up(1.5 * longest_s))
    notes["longest_relaxation_s"] = "fitted: the longest branch, times 1.5 assumed"
    return least_ohm


def _polarisation_factor(
    cell: IdentifiedCell, records: Sequence[Any], ohmic_factor: float
) -> float:
    """Factor on the branches with which 99 % of the measured overpotentials are reached.

    Beside the greatest ohmic resistance that steps have shown, and where the branches have come to
    half of their steady voltage.
    """
    steady_ohm = sum(branch.resistance_ohm for branch in cell.electrical.branches)
    fit, factors = cell.electrical, []
    for record in records:
        offset_V = rest_offset_V(fit, record, cell.alignment.capacity_Ah)
        ohmic_V = -record.current_A * fit.resistance_ohm(record.core_K, record.soc)
        branches_V = model_voltage_V(fit, record) - fit.ocv(record.soc) - ohmic_V
        measured_V = record.voltage_V - fit.ocv(record.soc) - offset_V - ohmic_factor * ohmic_V
        rows = (
            (record.soc > 0.1)
            & (record.soc < 0.95)
            & (np.abs(branches_V) > 0.5 * steady_ohm * np.abs(record.current_A))
            & (np.abs(record.current_A) > 0.1 * cell.alignment.capacity_Ah)
        )
        factors += (measured_V[rows] / branches_V[rows]).tolist()
    return float(np.quantile(factors, 0.99)) if factors else 2.0


def _capacity(
    cell: IdentifiedCell, rated: RatedLimits, factors: dict[str, Any], notes: dict[str, str]
) -> None:
    ratios = [own / cell.alignment.capacity_Ah for own in cell.alignment.capacities_Ah]
    factors["capacity"] = _around(rated.life_capacity * min(ratios), 1.02 * max(ratios))
    notes["capacity"] = (
        f"recordings agree within {min(ratios):.3f} to {max(ratios):.3f}; 2 % above; times "
        f"{rated.life_capacity:g} at the end of life ({rated.sources['life_capacity']})"
    )


def _open_circuit(cell: IdentifiedCell, factors: dict[str, Any], notes: dict[str, str]) -> None:
    fit, offsets = cell.electrical, []
    for record in electrical_records(cell.recordings, cell.alignment, cell.core_K):
        offset_V = rest_offset_V(fit, record, cell.alignment.capacity_Ah)
        inside = (record.soc > 0.1) & (record.soc < 0.98)
        if np.any(offset_V[inside]):
            offsets.append(np.abs(offset_V[inside]))
    rests_V = float(np.quantile(np.concatenate(offsets), 0.95)) if offsets else 0.0
    slow_V = max(fit.rmse_V[place] for place in cell.alignment.slow)
    error_V = max(rests_V, 2.0 * slow_V, _LEAST_OCV_V)
    note = f"long rests lie within {1e3 * rests_V:.0f} mV" if offsets else "no long rests"
    if len(cell.alignment.directions) < 2:
        error_V = max(error_V, _ONE_WAY_OCV_V)
        note += f"; {cell.alignment.directions[0]} alone, so at least 10 mV assumed"
    factors["ocv_error_V"] = math.ceil(1e3 * error_V) / 1e3
    notes["ocv_error_V"] = note


def _uncertainty(
    cell: IdentifiedCell, core: CoreDisturbance
) -> tuple[dict[str, float], dict[str, str]]:
    """Bounds on the disturbances, with where each comes from."""
    found = {
        "soc_per_s": 0.0,
        "core_K_per_s": _up(core.bound.constant_K_per_s),
        "surface_K_per_s": _UNCERTAINTY_K_PER_S,
        "coolant_K_per_s": _UNCERTAINTY_K_PER_S,
        "surface_rate_K_per_s2": 0.1,
    }
    notes = dict.fromkeys(found, "assumed") | {"core_K_per_s": core.at_rest}
    if cell.is_thermal_fitted:
        found["core_K_per_As"] = _up(core.bound.per_A_K_per_As)
        found["core_K_per_A2s"] = _up(core.bound.per_A2_K_per_A2s)
        notes |= dict.fromkeys(("core_K_per_As", "core_K_per_A2s"), core.growing)
    return found, notes


def _noise(cell: IdentifiedCell) -> dict[str, float]:
    """Standard deviations at rest: of differences between neighbouring rows."""
    found = {"current_A": 0.0, "voltage_V": 0.0, "surface_temperature_K": 0.0}
    for recording in cell.recordings:
        resting = np.abs(recording.current_A) < 0.01 * cell.alignment.capacity_Ah
        both = resting[1:] & resting[:-1] & (np.diff(recording.time_s) < 5.0)
        if np.sum(both) < 20:
            continue
        for name, values in (
            ("current_A", recording.current_A),
            ("voltage_V", recording.voltage_V),
            ("surface_temperature_K", recording.surface_K),
        ):
            if values is not None:
                # The median is not moved by the relaxation after a pulse.
                change = float(np.median(np.abs(np.diff(values)[both]))) / 0.6745 / math.sqrt(2.0)
                found[name] = max(found[name], change)
    return found


def _around(low: float, high: float) -> tuple[float, float]:
    return min(1.0, _down(low)), max(1.0, _up(high))


def _up(value: float) -> float:
    return _rounded(value, math.ceil)


def _down(value: float) -> float:
    return _rounded(value, math.floor)


def _rounded(value: float, towards: Any) -> float:
    if value <= 0.0:
        return 0.0
    digits = 2 - math.floor(math.log10(value))
    scaled = value * 10.0**digits
    near = round(scaled)
    whole = near if abs(scaled - near) < 1e-6 else towards(scaled)
    return float(f"{whole / 10.0**digits:.3g}")
