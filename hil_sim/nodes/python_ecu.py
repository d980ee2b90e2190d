"""A Python controller in the ECU's place: the same frames on the same bus."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from bms.baselines.cc_cv import CcCvController
from bms.decision import ACTIVE_CONSTRAINTS, Controller, Decision, Observation
from bms.presets import Preset
from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import CommandState, FirstFault, Message, Request
from hil_sim.bus.database import MessageCodec, Values
from hil_sim.bus.e2e import Receiver, Sender
from hil_sim.nodes.views import View

_SENT = (
    Message.ESTIMATE,
    Message.DECISION,
    Message.DECISION_MARGINS,
    Message.DIAGNOSTICS,
    Message.CHARGE_COMMAND,
)


class PythonEcu:
    """Runs a controller on what its view shows; has the interface of the firmware's Ecu.

    Requests come, and decisions go, as frames. Every charge gets a new controller.
    """

    def __init__(
        self,
        make_controller: Callable[[], Controller],
        preset: Preset,
        database: dict[str, MessageCodec],
        view: View,
    ) -> None:
        self._make_controller = make_controller
        self._controller: Controller | None = None
        self._limits = preset.limits
        self._view = view
        self._request_id = database[Message.CHARGE_REQUEST].frame_id
        self._request = Receiver(database[Message.CHARGE_REQUEST])
        self._plug_in_soc: float | None = None
        self._reference_A = 0.0
        self._complete = False
        self._senders = {name: Sender(database[name]) for name in _SENT}
        self._queue: list[Frame] = []

    def receive(self, frame_id: int, data: bytes) -> None:
        """Take in a charge request; other frames are for the view."""
        if frame_id != self._request_id:
            self._view.receive(frame_id, data)
            return
        request = self._request.accept(data)
        if request is None:
            return
        on = request["Request"] == Request.CHARGE
        self._plug_in_soc = request["PlugInStateOfCharge"] if on else None
        self._reference_A = request["ReferenceCurrent"] or 0.0

    def step(self) -> None:
        """Decide on what is seen in this period and queue the answer."""
        if self._plug_in_soc is None:
            self._controller, self._complete = None, False
        elif self._controller is None:
            self._controller = self._make_controller()
            self._view.begin(self._plug_in_soc)
        observation = self._view.observe(self._reference_A)
        decision = None
        if self._controller is not None:
            self._complete |= observation.soc >= self._limits.completion_soc
            if isinstance(self._controller, CcCvController):
                self._complete |= self._controller.is_full(observation)
            if not self._complete:
                decision = self._controller.decide(observation)
        values = _values(observation, decision, self._state(decision))
        self._queue = [sender.frame(values) for sender in self._senders.values()]

    def transmit(self) -> Sequence[tuple[int, bytes]]:
        """Frames of this step, ChargeCommand last."""
        queue, self._queue = self._queue, []
        return queue

    def _state(self, decision: Decision | None) -> CommandState:
        if decision is None:
            return CommandState.COMPLETE if self._complete else CommandState.STANDBY
        is_free = decision.current_A == self._reference_A
        return CommandState.CHARGING if is_free else CommandState.DERATED


def _values(observation: Observation, decision: Decision | None, state: CommandState) -> Values:
    knows_core = not math.isnan(observation.core_temperature_K)
    values: Values = {
        "CommandCurrent": decision.current_A if decision else 0.0,
        "CommandState": state,
        "DiagnosticState": state,
        "FirstFault": FirstFault.NONE,
        "ActiveFaults": 0,
        "LatchedFaults": 0,
        "CoreTemperature": observation.core_temperature_K,
        "StateOfCharge": observation.soc,
        "ErrorBound": 0.0 if knows_core else None,
        "InDomain": 1,
    }
    if decision is not None:
        margins = decision.margins
        values |= {
            "ActiveConstraint": ACTIVE_CONSTRAINTS.index(decision.active_constraint),
            "Feasible": int(decision.feasible),
            "LowerCurrent": decision.lower_A,
            "UpperCurrent": decision.upper_A,
            "VoltageMargin": margins.voltage_V,
            "SocMargin": margins.soc_per_s,
            "CoreMargin": margins.core_K_per_s,
            "SurfaceMargin": margins.surface_K_per_s2,
        }
    return values
