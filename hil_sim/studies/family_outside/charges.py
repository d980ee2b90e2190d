"""Charges of cells of which one property lies well outside of what the family says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from bms.cell import CellFactors, scaled
from bms.presets import Preset
from hil_sim.plant.true_cell import nominal_cell
from hil_sim.run.session import run_sil
from hil_sim.run.settings import Settings

LONGEST_S = 7200.0
_OVER_V, _OVER_K = 1e-4, 1e-3
"""By less than this a limit counts as kept."""
_NO_CURRENT_A = 0.05


@dataclass(frozen=True)
class Outside:
    """Factors on the nominal cell, and what is wrong with the charger."""

    factors: CellFactors = field(default_factory=CellFactors)
    told_soc: float = 0.0
    supply_tolerance: float = 0.0
    supply_lag_s: float = 0.0


OUTSIDE: Mapping[str, Outside] = MappingProxyType(
    {
        "ohmic resistance x 3": Outside(CellFactors(resistance=3.0)),
        "polarisation x 5": Outside(CellFactors(polarisation=5.0)),
        "resistance core to surface x 1.5": Outside(CellFactors(core_resistance=1.5)),
        "surface to coolant x 1.5": Outside(CellFactors(surface_resistance=1.5)),
        "heat capacity of the core x 0.5": Outside(CellFactors(core_heat_capacity=0.5)),
        "capacity x 0.5": Outside(CellFactors(capacity=0.5)),
        "dU/dT + 0.2 mV/K": Outside(CellFactors(entropic_error_V_per_K=2e-4)),
        "open-circuit voltage + 50 mV": Outside(CellFactors(ocv_error_V=0.05)),
        "told 20 % less than it has": Outside(told_soc=-0.2),
        "charger gives 30 % more": Outside(supply_tolerance=0.3),
        "charger with 5 s of lag": Outside(supply_lag_s=5.0),
    }
)


@dataclass(frozen=True)
class Outcome:
    """How far the limits were crossed at most, for how long current flowed into a cell that was
    over one, and how the charge ended.
    """

    case: str
    start_K: float
    core_over_K: float
    surface_over_K: float
    voltage_over_V: float
    charged_beyond_s: float
    end: str
    first_fault: int | None


def charge_outside(preset: Preset, case: str, start_K: float) -> Outcome:
    """Charge a cell of OUTSIDE; raises what run_sil raises."""
    outside = OUTSIDE[case]
    start = replace(preset.initial, temperature_K=start_K)
    cell = nominal_cell(preset, start)
    cell = replace(
        cell,
        cell=scaled(preset.cell, outside.factors),
        plug_in_soc=max(0.0, cell.plug_in_soc + outside.told_soc),
        state=cell.state._replace(soc=max(cell.state.soc, -outside.told_soc)),
        supply_tolerance=outside.supply_tolerance,
        supply_lag_s=outside.supply_lag_s,
    )
    result = run_sil(Settings(preset, initial=start, true_cell=cell, max_time_s=LONGEST_S))
    limits, series = preset.limits, result.series
    beyond = sum(
        current_A < -_NO_CURRENT_A
        and (
            core_K > limits.max_core_temperature_K + _OVER_K
            or surface_K > limits.max_surface_temperature_K + _OVER_K
            or voltage_V > limits.max_voltage_V + _OVER_V
        )
        for current_A, core_K, surface_K, voltage_V in zip(
            series.current_A,
            series.core_temperature_K,
            series.surface_temperature_K,
            series.voltage_V,
        )
    )
    summary = result.summary
    return Outcome(
        case=case,
        start_K=start_K,
        core_over_K=summary.max_core_temperature_K - limits.max_core_temperature_K,
        surface_over_K=summary.max_surface_temperature_K - limits.max_surface_temperature_K,
        voltage_over_V=summary.max_voltage_V - limits.max_voltage_V,
        charged_beyond_s=beyond * series.period_s,
        end=summary.stop_reason,
        first_fault=summary.first_fault,
    )
