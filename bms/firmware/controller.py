"""Estimator and controller of the firmware as Python calls."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bms.arrays import Array, Mask
from bms.barrier import sampling_margins
from bms.barrier.constants import surface_rate_in_force_K_per_s2
from bms.data.simulate import Samples
from bms.decision import ACTIVE_CONSTRAINTS, ConstraintMargins, Decision
from bms.errors import InputError
from bms.firmware._firmware import ffi, lib
from bms.firmware.calibration import calibration_block
from bms.kan.network import INPUT_NAMES
from bms.model.model_file import KanModel
from bms.model.pair import load_pair
from bms.presets import Preset
from bms.tables import network_tables

KAN_MEASURED_INPUTS = len(INPUT_NAMES)


class Estimate(NamedTuple):
    """Core temperature in K, and whether all inputs lie in the trained domain."""

    core_temperature_K: float
    in_domain: bool


class CompiledNetwork:
    """A trained network evaluated by the C code in float32."""

    def __init__(self, model: KanModel) -> None:
        """Raises InputError when the network exceeds the firmware's maxima."""
        self._tables, self._network = network_tables(model.network), model.network
        self._inputs = len(model.network.input_names)
        self._model = self._sampled_every(1.0)

    def evaluate(self, inputs: npt.ArrayLike) -> tuple[Array, Mask]:
        """Core temperature in K and domain flag, both (N,), for inputs (N, n_in)."""
        with np.errstate(over="ignore"):  # what float32 cannot hold is out of the domain
            rows = np.ascontiguousarray(inputs, dtype=np.float32)
        if rows.ndim != 2 or rows.shape[1] != self._inputs:
            raise ValueError(f"inputs must have shape (N, {self._inputs})")
        core, in_domain = np.empty(len(rows), np.float32), np.empty(len(rows), np.uint8)
        lib.host_estimate_rows(
            self._model,
            ffi.from_buffer("float[]", rows),
            len(rows),
            ffi.from_buffer("float[]", core, require_writable=True),
            ffi.from_buffer("uint8_t[]", in_domain, require_writable=True),
        )
        return core.astype(np.float64), in_domain.astype(np.bool_)

    def follow(self, recording: Samples) -> tuple[Array, Mask]:
        """As `evaluate`, for one recording that begins at rest; filters run in the firmware too.

        Only the first four inputs of the samples are used.
        """
        core, in_domain = np.empty(len(recording.time_s)), np.empty(len(recording.time_s), np.bool_)
        history, model = ffi.new("history_t *"), self._sampled_every(1.0)
        measured, before_A = ffi.new("float[]", KAN_MEASURED_INPUTS), 0.0
        steps_s = np.diff(recording.time_s, prepend=recording.time_s[0] - 1.0)
        for row, (inputs, step_s) in enumerate(zip(recording.inputs.tolist(), steps_s.tolist())):
            for place, lag in enumerate(self._network.lags):
                model.lag[place].decay, model.lag[place].gain = lag.decay(step_s), lag.gain(step_s)
            for place in range(KAN_MEASURED_INPUTS):
                measured[place] = inputs[place]
            # The current of a row flows until the next one; before the first the cell rested.
            lib.history_step(history, model, before_A, measured[2], True)
            before_A = inputs[0]
            estimate = lib.history_estimate(history, model, measured)
            core[row], in_domain[row] = estimate.core_temperature_K, estimate.in_domain
        return core, in_domain

    def _sampled_every(self, period_s: float) -> Any:
        """Tables in memory; a recording may be too short to settle, so nothing waits for that."""
        fields = self._tables.fields(self._network, period_s)
        return ffi.new("kan_model_t *", {**fields, "settling_periods": 0})


class Firmware:
    """Estimator and controller of one preset, as the firmware computes them.

    `model` is the path of a model file; None means the model that ships with the preset, which for
    the default preset is the compiled-in one. Raises InputError for unknown or unusable files and
    ModelMismatchError for a model that was trained for something else.
    """

    def __init__(
        self, preset: str | Path | Preset, model: str | Path | KanModel | None = None
    ) -> None:
        self.preset, self.model = load_pair(preset, model)
        self._calibration = calibration_block(self.preset, self.model, compiled_in=model is None)
        self._input = ffi.new("rcbf_input_t *")
        self._estimator_inputs = ffi.new("float[]", KAN_MEASURED_INPUTS)
        self._history = ffi.new("history_t *")

    def estimate(
        self,
        *,
        current_A: float,
        cooling_power_W: float,
        surface_temperature_K: float,
        coolant_temperature_K: float,
    ) -> Estimate:
        """Core temperature estimate for one set of measurements.

        A model with lagged inputs remembers: every call is one sampling period later, and nothing
        is in the domain until its filters have settled.
        """
        inputs = self._estimator_inputs
        inputs[0], inputs[1] = current_A, cooling_power_W
        inputs[2], inputs[3] = surface_temperature_K, coolant_temperature_K
        kan = ffi.addressof(self._calibration.kan)
        lib.history_step(self._history, kan, inputs[0], inputs[2], True)
        estimate = lib.history_estimate(self._history, kan, inputs)
        return Estimate(estimate.core_temperature_K, bool(estimate.in_domain))

    def solve(
        self,
        *,
        soc: float,
        core_temperature_K: float,
        surface_temperature_K: float,
        coolant_temperature_K: float,
        cooling_power_W: float,
        reference_current_A: float,
    ) -> Decision:
        """Charging current that is nearest to the reference within all constraints.

        The core temperature is the estimate; its error bound is in the constraints. Infeasible
        states and inputs that are not finite give 0 A with `feasible` false. Raises InputError for
        a preset with a family of cells, whose decisions rest on what was measured before.
        """
        if self.preset.cell.interval is not None:
            raise InputError(
                f"preset '{self.preset.name}': one state does not decide for a family of cells; "
                "use bms.firmware.Ecu, which observes it period by period"
            )
        write_decision_input(
            self._input,
            soc=soc,
            core_temperature_K=core_temperature_K,
            surface_temperature_K=surface_temperature_K,
            coolant_temperature_K=coolant_temperature_K,
            cooling_power_W=cooling_power_W,
            reference_current_A=reference_current_A,
        )
        answer = lib.rcbf_solve(ffi.addressof(self._calibration.rcbf), self._input)
        return Decision(
            current_A=answer.current_A,
            feasible=bool(answer.feasible),
            active_constraint=ACTIVE_CONSTRAINTS[answer.active],
            lower_A=answer.lower_A,
            upper_A=answer.upper_A,
            margins=ConstraintMargins(*answer.margins),
        )

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The numbers in force, by name with unit; read-only."""
        preset = self.preset
        cell, limits, gains = preset.cell, preset.limits, preset.gains
        bounds, margins = preset.uncertainty, sampling_margins(cell, preset)
        return MappingProxyType(
            {
                "core_resistance_K_per_W": cell.core_resistance_K_per_W,
                "core_heat_capacity_J_per_K": cell.core_heat_capacity_J_per_K,
                "surface_resistance_K_per_W": cell.surface_resistance_K_per_W,
                "surface_heat_capacity_J_per_K": cell.surface_heat_capacity_J_per_K,
                "coolant_heat_capacity_J_per_K": cell.coolant_heat_capacity_J_per_K,
                "ohmic_resistance_ohm": cell.ohmic_resistance_ohm,
                "entropic_coefficient_V_per_K": cell.entropic_coefficient_V_per_K,
                "capacity_Ah": cell.capacity_Ah,
                "ocv_soc": cell.ocv.soc,
                "ocv_V": cell.ocv.voltage_V,
                "max_voltage_V": limits.max_voltage_V,
                "max_soc": limits.max_soc,
                "max_core_temperature_K": limits.max_core_temperature_K,
                "max_surface_temperature_K": limits.max_surface_temperature_K,
                "reference_current_A": limits.reference_current_A,
                "completion_soc": limits.completion_soc,
                "alpha1": gains.alpha1_per_s,
                "alpha2": gains.core_gain_per_s(cell),
                "alpha3": gains.alpha3_per_s2,
                "alpha4": gains.alpha4_per_s,
                "soc_uncertainty_per_s": bounds.soc_per_s,
                "core_uncertainty_K_per_s": bounds.core_K_per_s,
                "surface_uncertainty_K_per_s": bounds.surface_K_per_s,
                "coolant_uncertainty_K_per_s": bounds.coolant_K_per_s,
                "surface_uncertainty_rate_K_per_s2": surface_rate_in_force_K_per_s2(cell, preset),
                "estimation_error_bound_K": self.model.error_bound_K,
                "sampling_period_s": preset.timing.sampling_period_s,
                "voltage_margin_V": margins.voltage_V,
                "soc_margin_per_s": margins.soc_per_s,
                "core_margin_K_per_s": margins.core_K_per_s,
                "surface_margin_K_per_s2": margins.surface_K_per_s2,
            }
        )


def write_decision_input(
    target: Any,
    *,
    soc: float,
    core_temperature_K: float,
    surface_temperature_K: float,
    coolant_temperature_K: float,
    cooling_power_W: float,
    reference_current_A: float,
) -> None:
    """Fill a rcbf_input_t."""
    target.soc, target.cooling_power_W = soc, cooling_power_W
    _set_temperature(target.core_temperature_K, core_temperature_K)
    _set_temperature(target.surface_temperature_K, surface_temperature_K)
    _set_temperature(target.coolant_temperature_K, coolant_temperature_K)
    target.reference_current_A = reference_current_A


def _set_temperature(target: Any, temperature_K: float) -> None:
    """Fill a rcbf_temperature_t: its first number rounds to float32, its second holds the rest."""
    target.high_K = temperature_K
    target.low_K = temperature_K - target.high_K
