"""The preset of an identified cell; every number with its source."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.bus_signals import RANGES
from bms.cell import CellInterval, CellParameters, OpenCircuitVoltage
from bms.cell.tables import EntropyTable, ResistanceTable
from bms.identification.cell_identification import IdentifiedCell
from bms.identification.cell_intervals import CellIntervals, cell_intervals
from bms.identification.core_disturbance import warmest_coolant_K
from bms.identification.electrical import RESISTANCE_SOC, growth
from bms.identification.rated import RatedLimits
from bms.identification.surface_thermal import ENTROPY_SOC
from bms.presets.schema import (
    CurrentMap,
    Gains,
    Initial,
    Limits,
    OperatingBox,
    PlugIn,
    Preset,
    Sensor,
    Sensors,
    Supply,
    Timing,
    Uncertainty,
)

_SOC_ERROR = 0.05
_TOLERANCE, _LAG_S = 0.05, 1.0
_BOX_ABOVE_K, _BOX_BELOW_K, _COOLANT_BELOW_K = 3.0, 0.5, 10.0
_MOST_COOLING_W = math.floor(0.9 * RANGES.cooling_power_W[1])
_OCV_SLOPE_BEYOND_V = 2.0
"""At least, where a slow recording ends flat below the voltage limit."""
_TAIL_H = 20.0
"""A charge is over when the voltage limit leaves C/20, at the latest."""


@dataclass(frozen=True)
class CellPreset:
    """A preset and by key, such as cell.capacity_Ah, where the number comes from."""

    preset: Preset
    notes: dict[str, str]


def cell_preset(
    cell: IdentifiedCell, rated: RatedLimits, name: str, given: dict[str, str]
) -> CellPreset:
    """The preset of a family around an identified cell, within its rated limits.

    `given` says by part (entropy) what came from elsewhere. A cell is full (1) where its
    open-circuit voltage reaches the voltage limit with the error of that voltage, so that no
    voltage within the limit overfills it; the charge is complete where the recordings' cell was, or
    where the most resistive cell of the family still takes C/20 below the voltage limit.
    """
    interval = cell_intervals(cell, rated)
    full = _full(cell, rated, interval)
    notes: dict[str, str] = {}
    parameters = _parameters(cell, rated, interval, full, given, notes)
    limits = _limits(rated, parameters, full, _voltage_sensor(interval), notes)
    uncertainty = _uncertainty(interval, notes)
    box = _box(rated, parameters, limits, uncertainty, notes)
    preset = Preset(
        name=name,
        description=f"Identified from {len(cell.recordings)} recordings without a measured core",
        sources=_sources(cell, interval, rated, given),
        cell=parameters,
        limits=limits,
        gains=_gains(parameters, notes),
        uncertainty=uncertainty,
        timing=Timing(0.1, 0.1),
        sensors=_sensors(limits, interval),
        initial=_initial(rated, limits, parameters, box, notes),
        operating_box=box,
        plug_in=_plug_in(cell, parameters, notes),
        supply=Supply(_TOLERANCE, _LAG_S),
        current_map=_map(rated, notes),
    )
    notes |= {
        "supply.tolerance": "assumed charger",
        "supply.lag_s": "assumed charger",
        "timing.sampling_period_s": "of the firmware, chosen",
        "timing.delay_s": "of the firmware, chosen",
        **{
            f"sensors.{channel}": "assumed BMS sensor: a share of the range, at least the noise "
            "at rest in the recordings"
            for channel in ("current_A", "voltage_V", "surface_temperature_K")
        },
        "sensors.coolant_temperature_K": "assumed BMS sensor",
        "sensors.cooling_power_W": "assumed BMS sensor",
    }
    return CellPreset(preset, notes)


@dataclass(frozen=True)
class _Full:
    """Scale of the state of charge: the recordings' 1 is `share` of the preset's."""

    share: float
    soc: tuple[float, ...]
    voltage_V: tuple[float, ...]
    slope_V: float


def _full(cell: IdentifiedCell, rated: RatedLimits, interval: CellIntervals) -> _Full:
    """The open-circuit voltage up to the voltage limit and its error."""
    soc, voltage_V = np.array(cell.electrical.ocv.soc), np.array(cell.electrical.ocv.voltage_V)
    end_V = rated.max_voltage_V + interval.ocv_error_V
    top = soc >= 0.95
    slope_V = max(
        float((voltage_V[top][-1] - voltage_V[top][0]) / (soc[top][-1] - soc[top][0])), 0.2
    )
    if voltage_V[-1] < end_V:
        beyond = (end_V - float(voltage_V[-1])) / slope_V
        soc, voltage_V = np.append(soc, 1.0 + beyond), np.append(voltage_V, end_V)
    else:
        at = float(np.interp(end_V, voltage_V, soc))
        keep = soc < at - 1e-3
        soc, voltage_V = np.append(soc[keep], at), np.append(voltage_V[keep], end_V)
    # Voltages rise by more than the rounding of the table.
    return _Full(
        1.0 / float(soc[-1]),
        tuple([*(round(float(s), 4) for s in (soc / soc[-1])[:-1]), 1.0]),
        tuple(round(float(v), 4) for v in voltage_V),
        round(max(slope_V * float(soc[-1]), _OCV_SLOPE_BEYOND_V), 2),
    )


def _parameters(
    cell: IdentifiedCell,
    rated: RatedLimits,
    interval: CellIntervals,
    full: _Full,
    given: dict[str, str],
    notes: dict[str, str],
) -> CellParameters:
    electrical, thermal = cell.electrical, cell.thermal[0]
    temperatures_K = _temperatures_K(rated)
    table = np.outer(growth(electrical.activation_K, temperatures_K), electrical.ohm)
    table = np.maximum(table, interval.least_ohm)
    seen_K = np.concatenate(cell.core_K)
    low_K, high_K = float(seen_K.min()), float(seen_K.max())
    mean_rmse_mV = 1e3 * float(np.sqrt(np.mean(np.array(electrical.rmse_V) ** 2)))
    rmse_K = float(np.sqrt(np.mean(np.array(thermal.rmse_K) ** 2))) if thermal.rmse_K else 0.0
    capacity_Ah = _figures(cell.alignment.capacity_Ah / full.share, 4)
    is_fitted = cell.is_thermal_fitted
    warming = (
        f"fitted to {', '.join(cell.thermal_names)}, surface RMSE {rmse_K:.2f} K"
        if is_fitted
        else "assumed: no recording warms by 2 K with its ambient"
    )
    entropy = given.get("entropy") or (
        f"fitted with it, error {1e4 * interval.entropic_error_V_per_K:.1f}e-4 V/K"
        if is_fitted
        else "assumed 0, interval"
    )
    steps = f"fitted, voltage RMSE {mean_rmse_mV:.0f} mV"
    notes |= {
        "cell.capacity_Ah": f"fitted: {cell.alignment.capacity_Ah:.4g} Ah in "
        f"{cell.alignment.reference} at C/{1 / cell.alignment.reference_rate_C:.3g}, and "
        f"{100 * (1 - full.share):.1f} % up to the voltage limit at rest",
        "cell.core_resistance_K_per_W": cell.shape.source,
        "cell.core_heat_capacity_J_per_K": warming,
        "cell.surface_resistance_K_per_W": f"{warming}; of the test's cooling",
        "cell.surface_heat_capacity_J_per_K": "assumed: 8 % of the cell's heat capacity",
        "cell.coolant_heat_capacity_J_per_K": "assumed: twice the cell's, no recording tells it",
        "cell.ohmic_resistance_ohm": f"{steps}: greatest of the table from 298 K on",
        "cell.entropic_coefficient_V_per_K": f"{entropy}: mean of the table",
        "cell.branches": steps,
        "cell.ocv.voltage_V": f"fitted: {cell.alignment.reference} less its overpotential, "
        f"{' and '.join(cell.alignment.directions)}; the last point is the voltage limit",
        "cell.ocv.overfill_slope_V": "assumed: the slope below, at least 2 V",
        "cell.resistance.ohm": f"{steps}, exp({electrical.activation_K:.0f} K/T); fitted from "
        f"{low_K:.0f} to {high_K:.0f} K, extrapolated beyond",
        "cell.entropy.V_per_K": entropy,
        **{f"cell.interval.{key}": text for key, text in interval.notes.items()},
    }
    entropic = thermal.entropic_V_per_K
    total = thermal.core_heat_capacity_J_per_K + thermal.surface_heat_capacity_J_per_K
    warm = table[temperatures_K >= 298.0] if np.any(temperatures_K >= 298.0) else table[-1:]
    return CellParameters(
        capacity_Ah=capacity_Ah,
        core_resistance_K_per_W=_figures(thermal.core_resistance_K_per_W),
        core_heat_capacity_J_per_K=_figures(thermal.core_heat_capacity_J_per_K),
        surface_resistance_K_per_W=_figures(thermal.surface_resistance_K_per_W),
        surface_heat_capacity_J_per_K=_figures(thermal.surface_heat_capacity_J_per_K),
        coolant_heat_capacity_J_per_K=_figures(2.0 * total, 2),
        ohmic_resistance_ohm=_figures(float(warm.max())),
        entropic_coefficient_V_per_K=_figures(float(np.mean(entropic))),
        ocv=OpenCircuitVoltage(full.soc, full.voltage_V, full.slope_V),
        resistance=ResistanceTable(
            tuple(float(value) for value in temperatures_K),
            tuple(round(float(value), 4) for value in RESISTANCE_SOC * full.share),
            tuple(tuple(_figures(value) for value in row) for row in table.tolist()),
        ),
        branches=electrical.branches,
        entropy=EntropyTable(
            tuple(round(float(value), 4) for value in ENTROPY_SOC * full.share),
            tuple(_figures(value) for value in entropic.tolist()),
        ),
        interval=CellInterval(**interval.factors),
    )


def _temperatures_K(rated: RatedLimits) -> Array:
    low_K, high_K = rated.coldest_K, max(rated.max_core_K, rated.warmest_K)
    count = max(2, math.ceil((high_K - low_K) / 10.0) + 1)
    return np.round(np.linspace(low_K, high_K, count), 2)


def _limits(
    rated: RatedLimits,
    cell: CellParameters,
    full: _Full,
    voltage: Sensor,
    notes: dict[str, str],
) -> Limits:
    sources = rated.sources
    recorded, provable = 0.995 * full.share, _provable_soc(rated, cell, voltage)
    completion = math.floor(1000.0 * min(0.99, recorded, provable)) / 1000.0
    notes |= {
        "limits.max_voltage_V": sources["max_voltage_V"],
        "limits.max_soc": "by definition: the open-circuit voltage is at the limit",
        "limits.max_core_temperature_K": sources["max_core_temperature_degC"],
        "limits.max_surface_temperature_K": sources["charge_temperature_degC"],
        "limits.reference_current_A": sources["max_charge_A"],
        "limits.current_growth_A_per_s": "chosen: 1C a second, at most the whole current in 2 s",
        "limits.completion_soc": "where the recordings' full cell was, less half a percent"
        if recorded <= provable
        else "the open-circuit voltage that C/20 leaves to the most resistive cell of the family",
    }
    return Limits(
        rated.max_voltage_V,
        1.0,
        round(rated.max_core_K, 3),
        round(rated.warmest_K, 3),
        -rated.max_charge_A,
        _figures(min(cell.capacity_Ah, 0.5 * rated.max_charge_A), 2),
        completion,
    )


def _provable_soc(rated: RatedLimits, cell: CellParameters, voltage: Sensor) -> float:
    """State of charge up to which a voltage within its limit proves that the cell is that full.

    From a reading goes off what the greatest resistances make of C/20, and all errors; so much must
    be left between the open-circuit voltage and the limit, or a charge comes to no end.
    """
    interval, table = cell.interval, cell.resistance
    assert interval is not None and table is not None
    ohm = np.array([row[-1] for row in table.ohm])
    at_298_K = float(np.interp(298.15, table.temperature_K, ohm))
    greatest_ohm = at_298_K * interval.resistance[1] + interval.polarisation[1] * sum(
        branch.resistance_ohm for branch in cell.branches
    )
    left_V = interval.ocv_error_V + 2.0 * voltage.error_bound
    left_V += greatest_ohm * cell.capacity_Ah / _TAIL_H
    return float(np.interp(rated.max_voltage_V - left_V, cell.ocv.voltage_V, cell.ocv.soc))


def _gains(cell: CellParameters, notes: dict[str, str]) -> Gains:
    rate = 1.0 / (cell.core_resistance_K_per_W * cell.core_heat_capacity_J_per_K)
    notes |= {
        "gains.alpha1_per_s": "chosen",
        "gains.alpha2_per_s": "chosen: three times 1/(Rc Cc)",
        "gains.alpha3_per_s2": "chosen",
        "gains.alpha4_per_s": "chosen",
    }
    return Gains(0.05, 0.05, 0.6, _figures(3.0 * rate, 2), "worst-case")


def _uncertainty(interval: CellIntervals, notes: dict[str, str]) -> Uncertainty:
    notes |= {f"uncertainty.{key}": text for key, text in interval.uncertainty_notes.items()}
    return Uncertainty(**interval.uncertainty)


def _sensors(limits: Limits, interval: CellIntervals) -> Sensors:
    range_A = -limits.reference_current_A
    noise = interval.noise
    return Sensors(
        Sensor(
            _figures(2e-4 * range_A, 1),
            _figures(max(2e-4 * range_A, noise["current_A"]), 1),
            _figures(5e-4 * range_A, 1),
        ),
        _voltage_sensor(interval),
        Sensor(0.01, _figures(max(0.005, noise["surface_temperature_K"]), 1), 0.05),
        Sensor(0.01, 0.005, 0.05),
        Sensor(0.005, 0.002, 0.01),
    )


def _voltage_sensor(interval: CellIntervals) -> Sensor:
    return Sensor(0.0005, _figures(max(0.0005, interval.noise["voltage_V"]), 1), 0.001)


def _heat_W(cell: CellParameters, limits: Limits) -> float:
    ohm = cell.ohmic_resistance_ohm + sum(branch.resistance_ohm for branch in cell.branches)
    return ohm * limits.reference_current_A**2


def _initial(
    rated: RatedLimits,
    limits: Limits,
    cell: CellParameters,
    box: OperatingBox,
    notes: dict[str, str],
) -> Initial:
    notes |= {
        "initial.soc": "chosen",
        "initial.temperature_K": "chosen",
        "initial.cooling_power_W": "chosen: half of the heat at the strongest current",
    }
    room_K = min(max(298.15, rated.coldest_K + 5.0), rated.warmest_K - 5.0)
    room_K = min(room_K, box.coolant_temperature_K[1])
    half_W = min(_figures(0.5 * _heat_W(cell, limits), 2), 0.5 * _MOST_COOLING_W)
    return Initial(0.1, round(room_K, 2), half_W)


def _box(
    rated: RatedLimits,
    cell: CellParameters,
    limits: Limits,
    noise: Uncertainty,
    notes: dict[str, str],
) -> OperatingBox:
    notes |= {
        "operating_box.current_A": "the strongest current with the charger's tolerance",
        "operating_box.cooling_power_W": "up to twice the heat at the strongest current, at "
        "most what the CAN bus carries",
        "operating_box.surface_temperature_K": "range of charging, and 3 K beyond",
        "operating_box.coolant_temperature_K": "10 K colder than the surface; up to where no "
        "disturbance takes a cell of the family over its limits without a current",
    }
    strongest_A = rated.max_charge_A
    power_W = _heat_W(cell, limits)
    top_K = max(rated.warmest_K, rated.max_core_K) + _BOX_ABOVE_K
    return OperatingBox(
        (-_figures(1.09 * strongest_A), _figures(0.02 * strongest_A, 2)),
        (-_figures(0.05 * power_W, 2), min(_figures(2.0 * power_W, 2), _MOST_COOLING_W)),
        (round(rated.coldest_K - _BOX_BELOW_K, 2), round(top_K, 2)),
        (
            round(rated.coldest_K - _COOLANT_BELOW_K, 2),
            min(round(top_K, 2), warmest_coolant_K(cell, limits, noise)),
        ),
    )


def _plug_in(cell: IdentifiedCell, parameters: CellParameters, notes: dict[str, str]) -> PlugIn:
    notes |= {
        "plug_in.soc_error": "assumed",
        "plug_in.coolant_offset_K": "assumed",
        "plug_in.core_excess_K": "assumed: after a drive",
        "plug_in.polarisation_V": "assumed: that of C/5, not yet at rest",
    }
    ohm = sum(branch.resistance_ohm for branch in parameters.branches)
    return PlugIn(_SOC_ERROR, 10.0, 15.0, round(max(0.005, 0.2 * ohm * parameters.capacity_Ah), 3))


def _map(rated: RatedLimits, notes: dict[str, str]) -> CurrentMap:
    notes["current_map.largest_A"] = (
        "assumed: a tenth at the cold end of the range, four tenths 10 K above, all from 20 K "
        "above on, against plating"
    )
    strongest_A, low_K = rated.max_charge_A, rated.coldest_K
    shares = (0.1, 0.4, 1.0)
    span_K = min(20.0, 0.8 * (rated.warmest_K - low_K))
    return CurrentMap(
        tuple(round(low_K + share * span_K, 2) for share in (0.0, 0.5, 1.0)),
        (0.0, 1.0),
        tuple((_figures(share * strongest_A),) * 2 for share in shares),
    )


def _sources(
    cell: IdentifiedCell,
    interval: CellIntervals,
    rated: RatedLimits,
    given: dict[str, str],
) -> tuple[str, ...]:
    names = ", ".join(recording.name for recording in cell.recordings)
    seen = [key for key, source in rated.sources.items() if source.startswith("not given")]
    lines = [
        f"bms identify, from {names}: what each number rests on stands beside it",
        f"core: {cell.shape.source}",
        *(f"{part}: {source}" for part, source in given.items()),
        *interval.remarks,
    ]
    if seen:
        lines.append(
            f"limits not given (--rated), so what the recordings have shown: {', '.join(seen)}"
        )
    return tuple(lines)


def _figures(value: float, count: int = 4) -> float:
    return float(f"{value:.{count}g}")
