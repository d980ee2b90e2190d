"""A Python controller in the ECU's place: the same frames on the same bus.

A baseline is given the true state of the cell by the plant and not by the bus, because that is
what its method assumes. Requests come, and decisions go, as frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from bms.cell import CellState
from bms.decision import ACTIVE_CONSTRAINTS, Controller, Decision, Observation
from bms.presets import Preset
from hil_sim.bus import Frame
from hil_sim.database import MessageCodec, Values
from hil_sim.e2e import Receiver, Sender
from hil_sim.nodes.plant import NO_FAULT, REQUEST_CHARGE

STANDBY, CHARGING, DERATED, COMPLETE = 1, 2, 3, 4
_SENT = ("Estimate", "Decision", "DecisionMargins", "Diagnostics", "ChargeCommand")


class OracleEcu:
    """Runs a controller on the true state; has the interface of the firmware's Ecu."""

    def __init__(
        self,
        controller: Controller,
        preset: Preset,
        database: dict[str, MessageCodec],
        truth: Callable[[], CellState],
        cooling_power_W: float,
    ) -> None:
        self._controller = controller
        self._limits = preset.limits
        self._truth = truth
        self._cooling_power_W = cooling_power_W
        self._request_id = database["ChargeRequest"].frame_id
        self._request = Receiver(database["ChargeRequest"])
        self._reference_A: float | None = None
        self._complete = False
        self._senders = {name: Sender(database[name]) for name in _SENT}
        self._queue: list[Frame] = []

    def receive(self, frame_id: int, data: bytes) -> None:
        """Take in a charge request; other frames are not needed."""
        if frame_id != self._request_id:
            return
        request = self._request.accept(data)
        if request is None:
            return
        on = request["Request"] == REQUEST_CHARGE
        self._reference_A = request["ReferenceCurrent"] if on else None
        self._complete = self._complete and on

    def step(self) -> None:
        """Decide on the present state and queue the answer."""
        state = self._truth()
        self._complete |= self._reference_A is not None and state.soc >= self._limits.completion_soc
        decision = None
        if self._reference_A is not None and not self._complete:
            decision = self._controller.decide(
                Observation(*state, self._cooling_power_W, self._reference_A)
            )
        values = _values(state, decision, self._state(decision))
        self._queue = [sender.frame(values) for sender in self._senders.values()]

    def transmit(self) -> Sequence[tuple[int, bytes]]:
        """Frames of this step, ChargeCommand last."""
        queue, self._queue = self._queue, []
        return queue

    def _state(self, decision: Decision | None) -> int:
        if decision is None:
            return COMPLETE if self._complete else STANDBY
        return CHARGING if decision.current_A == self._reference_A else DERATED


def _values(state: CellState, decision: Decision | None, state_number: int) -> Values:
    values: Values = {
        "CommandCurrent": decision.current_A if decision else 0.0,
        "CommandState": state_number,
        "DiagnosticState": state_number,
        "FirstFault": NO_FAULT,
        "ActiveFaults": 0,
        "LatchedFaults": 0,
        "CoreTemperature": state.core_temperature_K,
        "StateOfCharge": state.soc,
        "ErrorBound": 0.0,
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
