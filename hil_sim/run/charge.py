"""One charge: plant, sensors and charger on one side of the bus, the ECU on the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bms.errors import BusError, ModelMismatchError
from bms.image import UNKNOWN_CONTENT, content_text, foreign_content
from bms.presets import Preset
from hil_sim.bus.catalog import CommandState, FirstFault, Mode
from hil_sim.bus.identity import Identity
from hil_sim.bus.refusal import refusal_text
from hil_sim.faults import Injection
from hil_sim.nodes.plant import Answer, PlantNode, Request
from hil_sim.plant.charger import Charger
from hil_sim.plant.seam import PlantLike
from hil_sim.plant.sensors import Readings, SensorSuite
from hil_sim.run.result import (
    STOP_COMPLETE,
    STOP_FAULT,
    STOP_SILENT,
    STOP_TIME_LIMIT,
    TimeSeries,
)

OFF_PERIODS = 5
"""Periods with the request off before the charge, in which the ECU starts and gets ready."""
READY_PERIODS = 100
"""Periods after which an ECU that is not ready is given up."""
STARTING_PERIODS = 20_000
"""The same while it says that it is still starting: an estimator with memory has to settle."""
SILENT_PERIODS = 5
"""Periods without an intact command that end a run; the charger has stopped well before."""

BOOT_STAGE_VERSION = 0
"""In place of that of a firmware; the boot stage says in a message of its own why it is there."""

Progress = Callable[[float], None]

_COMPLETE, _FAULT = CommandState.COMPLETE.label, CommandState.FAULT.label


@dataclass
class Charge:
    """A charge from plug-in until full, fault, silence or time limit; else until the last alone."""

    preset: Preset
    node: PlantNode
    plant: PlantLike
    sensors: SensorSuite
    charger: Charger
    injection: Injection
    max_time_s: float
    ends_early: bool = True
    model_hash: str | None = None
    """The model that the ECU has to have; None for any."""
    content: int | None = None
    """The content that its calibration has to have, as the ECU counts it; None for that of the
    shipped model and preset which the ECU names, and any where these do not ship."""
    plug_in_soc: float | None = None
    """State of charge that the charger tells the ECU; None for the true one."""
    progress: Progress = lambda soc: None
    mode: Mode | None = None
    full_by_s: float | None = None

    def __post_init__(self) -> None:
        self.series = TimeSeries(self._period_s)
        self.steps = 0
        self.identity: Identity | None = None
        self._heard_identity: Identity | None = None
        self._is_content_known = False
        self.error_bound_K: float | None = None
        self.first_fault: int | None = None
        self._edge: int | None = None
        self._silent_periods = 0
        self._plug_in_soc = self.plant.state.soc if self.plug_in_soc is None else self.plug_in_soc

    def run(self) -> str:
        """Run to the end and return why it ended.

        Raises BusError when no ECU gets ready or its boot stage refuses the image, and
        ModelMismatchError when it has another preset or model.
        """
        while True:
            self.node.wait()
            self.injection.begin(self._charge_period, self.plant)
            answer = self.node.exchange(self.steps, self._measure(), self._request())
            self.plant.current_A = self.injection.supplied_A(
                self.charger.current_A(answer.usable_command_A), self.plant.current_A
            )
            self._note(answer)
            self.steps += 1
            reason = self._stop_reason(answer)
            if reason is not None:
                return reason
            self._prepare(answer)
            self.plant.advance()
            self.progress(self.plant.state.soc)

    @property
    def _period_s(self) -> float:
        return self.preset.timing.sampling_period_s

    @property
    def _charge_period(self) -> int | None:
        return None if self._edge is None else self.steps - self._edge

    def _measure(self) -> Readings:
        plant = self.plant
        healthy = self.sensors.read(
            Readings(
                plant.current_A,
                plant.voltage_V,
                plant.state.surface_temperature_K,
                plant.state.coolant_temperature_K,
                plant.cooling_power_W,
            )
        )
        return self.injection.readings(healthy, plant.state)

    def _request(self) -> Request:
        reference_A = self.preset.limits.reference_current_A
        return Request(
            self._edge is not None, reference_A, self._plug_in_soc, self.mode, self._time_left_s()
        )

    def _time_left_s(self) -> float | None:
        """What is left of the time in which to be full; None where there is none to keep."""
        if self.full_by_s is None:
            return None
        return max(0.0, self.full_by_s - (self._charge_period or 0) * self._period_s)

    def _prepare(self, answer: Answer) -> None:
        """Switch the request on once the ECU is ready, not before OFF_PERIODS."""
        if self._edge is not None or self.steps < OFF_PERIODS:
            return
        is_known = self.model_hash is None or self.identity is not None
        is_known = is_known and (self.content is None or self._is_content_known)
        if answer.state == CommandState.STANDBY.label and is_known:
            self._edge = self.steps
            return
        is_starting = answer.state == CommandState.INIT.label
        if self.steps >= (STARTING_PERIODS if is_starting else READY_PERIODS):
            raise BusError(
                f"the ECU is not ready after {self.steps} periods (state: {answer.state or 'none'}"
                f"{'' if is_known else ', model or content unknown'}); "
                "see the fault bits of its Diagnostics message"
            )

    def _note(self, answer: Answer) -> None:
        plant, begin = self.plant, self._edge if self._edge is not None else OFF_PERIODS
        time_s = (self.steps - begin) * self._period_s
        self.series.append(
            self._charge_period, time_s, plant.state, plant.current_A, plant.voltage_V, answer
        )
        self._silent_periods = 0 if answer.command_A is not None else self._silent_periods + 1
        if self._edge is not None and answer.value("ErrorBound") is not None:
            self.error_bound_K = answer.value("ErrorBound")
        fault = answer.value("FirstFault")
        if fault is not None and fault != FirstFault.NONE:
            self.first_fault = int(fault)
        part, check = answer.value("RefusedPart"), answer.value("FailedCheck")
        if part is not None or check is not None:
            raise BusError(f"the ECU does not start: {refusal_text(part, check)}")
        identity = Identity.of(answer.value)
        if identity is not None and identity.firmware_version != BOOT_STAGE_VERSION:
            # The message is not protected: one that contradicts the first has to come twice.
            if self.identity is None or identity in (self.identity, self._heard_identity):
                self._check(identity)
                self.identity = identity
            self._heard_identity = identity
        content = answer.value("CalibrationContent")
        if content is not None and content != UNKNOWN_CONTENT:
            self._check_content(int(content))
            self._is_content_known = True

    def _check(self, identity: Identity) -> None:
        if identity.other_version is not None:
            raise BusError(f"the ECU speaks {identity.other_version}; flash it anew")
        if not self.preset.hash.startswith(identity.preset_hash):
            raise ModelMismatchError(
                f"the ECU runs a preset with hash {identity.preset_hash}..., the plant "
                f"'{self.preset.name}' with {self.preset.hash[:4]}...; give the plant the "
                "preset of the ECU by --preset, or start the ECU with that of the plant: "
                "'bms ecu --bus BUS --preset PRESET', a board by 'bms export --preset PRESET --out "
                "out/export' and 'bms flash --calibration out/export/calibration.bin'"
            )
        if self.model_hash is not None and not self.model_hash.startswith(identity.model_hash):
            raise ModelMismatchError(
                f"the ECU runs a model with hash {identity.model_hash}..., not "
                f"{self.model_hash[:8]}...; name with --model the one that it has, or give a board "
                "that model: 'bms export --preset PRESET --model MODEL --out out/export' and "
                "'bms flash --calibration out/export/calibration.bin'"
            )

    def _check_content(self, content: int) -> None:
        """Model and preset by hash are what the calibration was made from, not what it is."""
        wrong: str | None = None
        if self.content is not None and content != self.content:
            wrong = content_text(content, self.content)
        elif self.content is None and self.identity is not None:
            known = self.identity
            wrong = foreign_content(known.model_hash, known.preset_hash, content)
        if wrong is not None:
            raise ModelMismatchError(f"the ECU gets no charge: {wrong}")

    def _stop_reason(self, answer: Answer) -> str | None:
        if self._edge is None:
            return None
        if self.ends_early and self._silent_periods >= SILENT_PERIODS:
            return STOP_SILENT
        if self.ends_early:
            state = answer.state
            if state == _COMPLETE:
                return STOP_COMPLETE
            if state == _FAULT:
                return STOP_FAULT
        if (self.steps - self._edge) * self._period_s >= self.max_time_s:
            return STOP_TIME_LIMIT
        return None
