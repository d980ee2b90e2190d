"""Charges in C: one object for one charge, stepped in blocks of control periods."""

from __future__ import annotations

from typing import Any

import numpy as np

from bms.arrays import Array
from bms.barrier import barrier_constants
from bms.baselines.cc_cv import CUT_BACK_SPAN_K, REACHED_V, tail_current_A
from bms.baselines.measured_cell import charging_voltage_V
from bms.calibration import calibration_fields
from bms.presets import Preset
from bms.presets.schema import Sensor
from codegen.can_database import load_database
from hil_sim.native.cell_fields import cell_fields
from hil_sim.plant.charger import lag_share
from hil_sim.plant.sensors import Readings
from hil_sim.plant.true_cell import COOLING_BAND_K, TrueCell
from hil_sim.run.charge import OFF_PERIODS, READY_PERIODS, STARTING_PERIODS
from hil_sim.studies.campaign._runner import ffi, lib
from hil_sim.studies.campaign.nominal import nominal_fields
from hil_sim.studies.campaign.settings import CampaignSettings

SUB_STEPS: int = lib.CHARGE_SUB_STEPS
CONTROLLERS = {
    "kan-rcbf": lib.CHARGE_KAN_RCBF,
    "s-cbf": lib.CHARGE_S_CBF,
    "cc-cv": lib.CHARGE_CC_CV,
}
"""Controllers that a campaign counts side by side, with their numbers in C."""
OUTCOMES = ("running", "complete", "fault", "time-limit", "not-ready")

_READING_SIGNALS = (
    "Current",
    "Voltage",
    "SurfaceTemperature",
    "CoolantTemperature",
    "CoolingPower",
)


class Scenario:
    """What all charges of a campaign share: sensors, bus, controllers, the firmware's tables."""

    def __init__(self, settings: CampaignSettings) -> None:
        """Raises InputError or ModelMismatchError as bms.tables.calibration_fields does."""
        preset = settings.preset
        self.preset = preset
        fields = calibration_fields(preset, settings.model, settings.firmware_changes)
        if settings.nominal_part is not None:
            fields["family"] = nominal_fields(preset, settings.nominal_part)
        self.calibration = ffi.new("bms_calibration_t *", fields)
        self.fields = ffi.new(
            "charge_scenario_t *",
            {
                "period_s": preset.timing.sampling_period_s,
                "max_time_s": settings.max_time_s,
                "reference_current_A": preset.limits.reference_current_A,
                "has_mode": settings.mode is not None,
                "mode": settings.mode or 0,
                "full_by_s": -1.0,
                "completion_soc": preset.limits.completion_soc,
                "cooling_band_K": COOLING_BAND_K,
                "noise_cutoff": Sensor.NOISE_CUTOFF,
                "off_periods": OFF_PERIODS,
                "ready_periods": READY_PERIODS,
                "starting_periods": STARTING_PERIODS,
                "nominal": cell_fields(preset.cell, preset.timing.sampling_period_s / SUB_STEPS),
                "sensors": [_sensor(getattr(preset.sensors, name)) for name in Readings._fields],
                "core_bound": _core_bound(preset),
                "signals": _signals(),
                "baselines": _baselines(preset),
            },
        )


class CampaignCharge:
    """One cell on one controller; `fields` is the C structure with everything that is known."""

    def __init__(
        self,
        scenario: Scenario,
        controller: str,
        true_cell: TrueCell,
        first_knot: Array,
        watches_model_error: bool = False,
    ) -> None:
        """The first knot is the disturbance at the beginning, (4,)."""
        self._scenario = scenario
        period_s = scenario.preset.timing.sampling_period_s
        self.fields: Any = ffi.new(
            "charge_t *",
            {
                "scenario": scenario.fields,
                "controller": CONTROLLERS[controller],
                "cell": cell_fields(true_cell.cell, period_s / SUB_STEPS),
                "full_cooling_W": true_cell.cooling_power_W,
                "coolant_floor_K": true_cell.coolant_floor_K,
                "plug_in_soc": true_cell.plug_in_soc,
                "bias": tuple(true_cell.biases),
                "supply_gain": 1.0 + true_cell.supply_tolerance,
                "supply_share": lag_share(period_s, true_cell.supply_lag_s),
                "watches_model_error": watches_model_error,
                "memory": {
                    "state": tuple(true_cell.state),
                    "polarisation_V": tuple(true_cell.polarisation_V),
                },
                "knot": tuple(map(float, first_knot)),
            },
        )
        lib.charge_begin(self.fields, scenario.calibration)

    @property
    def mean_core_temperature_K(self) -> float:
        """Mean over the control periods of the charge so far."""
        fields = self.fields
        periods: int = max(fields.periods - fields.edge_period, 1)
        return float(fields.core_sum_K) / periods

    @property
    def is_over(self) -> bool:
        """Whether the charge has come to an end."""
        return bool(self.fields.outcome != lib.CHARGE_RUNNING)

    @property
    def outcome(self) -> str:
        """How it ended, one of OUTCOMES."""
        return OUTCOMES[self.fields.outcome]

    def advance(self, normals: Array, knots: Array) -> None:
        """Run n periods or to the end: standard normals (n, 5), knots (n SUB_STEPS, 4)."""
        if normals.shape[1:] != (5,) or knots.shape != (len(normals) * SUB_STEPS, 4):
            raise ValueError("normals must have shape (n, 5) and knots (n * SUB_STEPS, 4)")
        lib.charge_advance(self.fields, _doubles(normals), _doubles(knots), len(normals))


def limit_slope(knots: Array, before: float, largest_change: float) -> None:
    """Make the surface disturbance of knots (n, 4) change by at most largest_change a knot."""
    lib.charge_limit_slope(
        ffi.from_buffer("double[]", knots, require_writable=True),
        len(knots),
        before,
        largest_change,
    )


def _sensor(sensor: Sensor) -> dict[str, float]:
    return {"resolution": sensor.resolution, "noise_std": sensor.noise_std}


def _core_bound(preset: Preset) -> dict[str, float]:
    bounds = preset.uncertainty
    return {
        "constant_K_per_s": bounds.core_K_per_s,
        "per_A_K_per_As": bounds.core_K_per_As,
        "per_A2_K_per_A2s": bounds.core_K_per_A2s,
        "at_reference_K_per_s": bounds.core_at_K_per_s(preset.limits.reference_current_A),
    }


def _doubles(values: Array) -> Any:
    return ffi.from_buffer("double[]", np.ascontiguousarray(values, dtype=np.float64))


def _signals() -> dict[str, Any]:
    signals = {
        signal.name: {
            "scale": signal.scale,
            "offset_steps": round(signal.offset / signal.scale),
            "lowest": round((signal.minimum - signal.offset) / signal.scale),
            "highest": round((signal.maximum - signal.offset) / signal.scale),
        }
        for message in load_database().messages
        for signal in message.signals
        if signal.minimum is not None and signal.maximum is not None
    }
    return {
        "readings": [signals[name] for name in _READING_SIGNALS],
        "reference_current": signals["ReferenceCurrent"],
        "plug_in_soc": signals["PlugInStateOfCharge"],
        "command_current": signals["CommandCurrent"],
    }


def _baselines(preset: Preset) -> dict[str, float]:
    cell, limits, gains = preset.cell, preset.limits, preset.gains
    constants = barrier_constants(cell, preset)
    return {
        "strongest_current_A": limits.reference_current_A,
        "capacity_As": cell.capacity_As,
        "ohmic_resistance_ohm": cell.ohmic_resistance_ohm,
        "max_voltage_V": limits.max_voltage_V,
        "max_soc": limits.max_soc,
        "max_surface_temperature_K": limits.max_surface_temperature_K,
        "alpha1_per_s": gains.alpha1_per_s,
        "alpha3_per_s2": gains.alpha3_per_s2,
        "a4_per_s2": constants.a4_per_s2,
        "a6_per_s2": constants.a6_per_s2,
        "a9_K_per_A2s2": constants.a9_K_per_A2s2,
        "a10_K_per_Ws2": constants.a10_K_per_Ws2,
        "charging_voltage_V": charging_voltage_V(preset),
        "reached_V": charging_voltage_V(preset) - REACHED_V,
        "tail_current_A": tail_current_A(preset),
        "cut_back_begin_K": limits.max_surface_temperature_K - CUT_BACK_SPAN_K,
        "cut_back_end_K": limits.max_surface_temperature_K,
    }
