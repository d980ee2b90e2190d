"""A run of a campaign as a row of runs.csv: what was drawn, and how each controller did."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

from bms.cell import CellFactors
from bms.presets import Preset
from hil_sim.bus.catalog import FirstFault
from hil_sim.plant.sensors import Readings
from hil_sim.studies.campaign.draws import Draw
from hil_sim.studies.campaign.engine import CONTROLLERS, CampaignCharge
from hil_sim.studies.campaign.real_draws import RealDraw, disturbance_W
from hil_sim.studies.campaign.settings import CellFamily

FIRMWARE = "kan-rcbf"

Row = dict[str, Any]

_PER_CHARGE = (
    "outcome",
    "charge_time_s",
    "max_core_temperature_K",
    "max_surface_temperature_K",
    "max_voltage_V",
    "max_soc",
    "final_soc",
)
_PUBLISHED_DRAW = (
    "run",
    "family",
    "core_resistance_K_per_W",
    "core_heat_capacity_J_per_K",
    "surface_resistance_K_per_W",
    "soc",
    "temperature_K",
    "cooling_power_W",
    "disturbance",
    "disturbance_share",
)
_OF_FIRMWARE = ("first_fault", "infeasible_periods", "max_estimate_error_K")
_MODEL_ERRORS = (
    "core_model_error_K_per_s",
    "surface_model_error_K_per_s",
    "coolant_model_error_K_per_s",
    "surface_model_error_slope_K_per_s2",
    "inside",
)
_REAL_DRAW = (
    "run",
    *(field.name for field in fields(CellFactors)),
    "plug_in_soc",
    "soc",
    "core_temperature_K",
    "surface_temperature_K",
    "coolant_temperature_K",
    "polarisation_V",
    "cooling_power_W",
    "coolant_floor_K",
    "disturbance",
    "supply_tolerance",
    "supply_lag_s",
    *(f"bias_{name}" for name in Readings._fields),
)


def header(family: CellFamily) -> str:
    """First line of runs.csv: the names of its columns."""
    return ",".join(columns(family)) + "\n"


def columns(family: CellFamily) -> list[str]:
    """Names of the columns of runs.csv; values of a controller have its name in front."""
    is_real = family is CellFamily.REAL
    per_charge = (*_PER_CHARGE, "stops") if is_real else _PER_CHARGE
    return [
        *(_REAL_DRAW if is_real else _PUBLISHED_DRAW),
        *(f"{prefix(name)}_{column}" for name in CONTROLLERS for column in per_charge),
        *_OF_FIRMWARE,
        *(() if is_real else _MODEL_ERRORS),
    ]


def prefix(controller: str) -> str:
    """Controller's name as it begins a column's name."""
    return controller.replace("-", "_")


def row(preset: Preset, run: int, drawn: Draw, charges: dict[str, CampaignCharge]) -> Row:
    """Row of a cell from the published intervals."""
    fields = charges[FIRMWARE].fields
    error = fields.peaks.model_error
    slope_K_per_s2 = fields.peaks.surface_error_slope_K_per_s2
    bounds = preset.uncertainty
    inside = (
        error.soc <= bounds.soc_per_s
        and error.core <= bounds.core_K_per_s
        and error.surface <= bounds.surface_K_per_s
        and error.coolant <= bounds.coolant_K_per_s
        and slope_K_per_s2 <= bounds.surface_rate_K_per_s2
        # With less cooling the disturbance heats the cell without end, charged or not.
        and drawn.cooling_power_W >= disturbance_W(preset, drawn.cell)
    )
    return {
        "run": run,
        "family": drawn.family.value,
        "core_resistance_K_per_W": drawn.cell.core_resistance_K_per_W,
        "core_heat_capacity_J_per_K": drawn.cell.core_heat_capacity_J_per_K,
        "surface_resistance_K_per_W": drawn.cell.surface_resistance_K_per_W,
        "soc": drawn.soc,
        "temperature_K": drawn.temperature_K,
        "cooling_power_W": drawn.cooling_power_W,
        "disturbance": drawn.disturbance.value,
        "disturbance_share": drawn.disturbance_share,
        **_charged(charges),
        **_of_firmware(charges),
        "core_model_error_K_per_s": error.core,
        "surface_model_error_K_per_s": error.surface,
        "coolant_model_error_K_per_s": error.coolant,
        "surface_model_error_slope_K_per_s2": slope_K_per_s2,
        "inside": int(inside),
    }


def real_row(run: int, drawn: RealDraw, charges: dict[str, CampaignCharge]) -> Row:
    """Row of a cell from the preset's family."""
    cell = drawn.cell
    return {
        "run": run,
        **asdict(drawn.factors),
        "plug_in_soc": cell.plug_in_soc,
        **cell.state._asdict(),
        "polarisation_V": sum(cell.polarisation_V),
        "cooling_power_W": cell.cooling_power_W,
        "coolant_floor_K": cell.coolant_floor_K,
        "disturbance": drawn.disturbance.value,
        "supply_tolerance": cell.supply_tolerance,
        "supply_lag_s": cell.supply_lag_s,
        **{f"bias_{name}": bias for name, bias in cell.biases._asdict().items()},
        **_charged(charges),
        **{f"{prefix(name)}_stops": charge.fields.stops for name, charge in charges.items()},
        **_of_firmware(charges),
    }


def _charged(charges: dict[str, CampaignCharge]) -> Row:
    result: Row = {}
    for name, charge in charges.items():
        peaks = charge.fields.peaks.cell
        values = {
            "outcome": charge.outcome,
            "charge_time_s": charge.fields.time_s if charge.outcome == "complete" else "",
            "max_core_temperature_K": peaks.core_temperature_K,
            "max_surface_temperature_K": peaks.surface_temperature_K,
            "max_voltage_V": peaks.voltage_V,
            "max_soc": peaks.soc,
            "final_soc": charge.fields.memory.state.soc,
        }
        result |= {f"{prefix(name)}_{key}": value for key, value in values.items()}
    return result


def _of_firmware(charges: dict[str, CampaignCharge]) -> Row:
    fields = charges[FIRMWARE].fields
    return {
        "first_fault": "" if fields.first_fault == FirstFault.NONE else fields.first_fault,
        "infeasible_periods": fields.infeasible_periods,
        "max_estimate_error_K": fields.peaks.estimate_error_K,
    }
