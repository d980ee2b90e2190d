"""The plant's side of the bus: publishes measurements and the request, collects the answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bms.errors import BusError
from bms.firmware import Reception, ReceptionCounts
from hil_sim.bus import catalog
from hil_sim.bus.buses import CanBus, Frame, ecu_remedy, is_serial_line
from hil_sim.bus.catalog import Message
from hil_sim.bus.database import COUNTER_MODULUS, MessageCodec, Values
from hil_sim.bus.e2e import Receiver, Sender
from hil_sim.bus.fault_bits import FaultBits
from hil_sim.bus.identity import Identity
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.turns import MOST_FRAMES, Turn
from hil_sim.plant.sensors import Readings

CONNECT_ATTEMPTS = 10

_REPORTS = (
    Message.ESTIMATE,
    Message.DECISION,
    Message.DECISION_MARGINS,
    Message.DIAGNOSTICS,
    Message.NETWORK_DIAGNOSTICS,
    Message.DIAGNOSTICS2,
    Message.PLAN,
    Message.IDENTITY,
    Message.BOOT_REFUSAL,
)
_STATES = {state.value: state.label for state in catalog.CommandState}
_CONSTRAINTS = {constraint.value: constraint.label for constraint in catalog.ActiveConstraint}

Delivery = Callable[[list[Frame]], list[Frame]]
"""Frames that arrive in place of those that were sent."""
StampedFrame = tuple[float, Frame]
"""A frame with its time in s."""


@dataclass(frozen=True)
class Request:
    """What the charger asks for: on or off, the current wanted (A), state of charge at plug-in.

    Without a mode the charger leaves the message that asks for one out. The time in which to be
    full (s, from now) is for ByTime alone.
    """

    charge: bool
    reference_current_A: float
    plug_in_soc: float
    mode: catalog.Mode | None = None
    time_to_full_s: float | None = None


class Answer:
    """What the ECU said in one period: values by signal name, None where it said nothing."""

    def __init__(self, values: Values, is_command_usable: bool, latched_faults: int | None) -> None:
        self._values = values
        self._is_command_usable = is_command_usable
        self.latched_faults = latched_faults
        """Bit n for fault n; None where the ECU said nothing."""

    def value(self, signal: str) -> float | None:
        """Value of a signal in the database's unit."""
        return self._values.get(signal)

    @property
    def command_A(self) -> float | None:
        """Commanded current in A."""
        return self.value("CommandCurrent")

    @property
    def usable_command_A(self) -> float | None:
        """Commanded current in A that a charger may use: the message is valid, not only intact."""
        return self.command_A if self._is_command_usable else None

    @property
    def state(self) -> str | None:
        """Name of the ECU's state, in small letters."""
        return _label(_STATES, self.value("CommandState"))

    @property
    def active_constraint(self) -> str | None:
        """Name of the constraint that decided, in small letters."""
        return _label(_CONSTRAINTS, self.value("ActiveConstraint"))

    @property
    def feasible(self) -> bool | None:
        """Whether the constraints left a current to choose."""
        value = self.value("Feasible")
        return bool(value) if value in (0, 1) else None


class PlantNode:
    """Talks to the ECU over a bus, one control period at a time."""

    def __init__(
        self,
        bus: CanBus,
        database: dict[str, MessageCodec],
        turn: Turn,
        recorder: Recorder | None = None,
        sent: Delivery = list,
        heard: Delivery = list,
    ) -> None:
        """`sent` and `heard` say what arrives of the frames on their way to and from the ECU.

        What is recorded is what the ECU gets and what it says.
        """
        self._bus = bus
        self._sent, self._heard = sent, heard
        self._turn = turn
        self._recorder = recorder
        self._electrical = Sender(database[Message.CELL_ELECTRICAL])
        self._thermal = Sender(database[Message.CELL_THERMAL])
        self._coolant = Sender(database[Message.COOLANT])
        self._request = Sender(database[Message.CHARGE_REQUEST])
        self._mode = Sender(database[Message.CHARGE_MODE])
        self._sync = Frame(database[Message.SYNC].frame_id, b"")
        self._receivers = {database[name].frame_id: Receiver(database[name]) for name in _REPORTS}
        self._identity = database[Message.IDENTITY]
        self._command = database[Message.CHARGE_COMMAND]
        self._reception = Reception(self._command.frame_id)
        self._faults = FaultBits()
        self._foreign_version: str | None = None
        self._last_counter: int | None = None
        self._is_connected = False
        self._is_answer_late = False

    @property
    def command_counts(self) -> ReceptionCounts:
        """Charge commands that were not as they should be."""
        return self._reception.counts

    def wait(self) -> None:
        """Return when the next period is due; at once in virtual time."""
        self._turn.wait()

    def exchange(self, period: int, readings: Readings, request: Request) -> Answer:
        """Publish what is measured and wanted in a period, and return what the ECU answers.

        Until an ECU has answered for the first time, a period of a lock step is offered again
        with the same frames, so that the ECU may start later than the plant. A line keeps what
        an ECU has not read yet, which would then hear the period twice: there the plant only goes
        on listening. Raises BusError when none comes.
        """
        frames = self._sent(self._frames(readings, request))
        late = self._late_frames(period) if self._is_answer_late else []
        self._turn.begin()
        sent_s, heard = self._converse(period, frames)
        self._is_answer_late = not self._is_answered(heard)
        self._follow([frame for _, frame in (*late, *heard)])
        if self._recorder is not None:
            for time_s, frame in late:
                self._recorder.record(time_s, frame, received=True)
            for frame in frames:
                self._recorder.record(sent_s, frame, received=False)
            for time_s, frame in heard:
                self._recorder.record(time_s, frame, received=True)
        return self._answer(self._heard([frame for _, frame in heard]))

    def _converse(self, period: int, frames: list[Frame]) -> tuple[float, list[StampedFrame]]:
        """When the frames were published last, in s, and what was heard since."""
        sent_s, heard = 0.0, list[StampedFrame]()
        for attempt in range(CONNECT_ATTEMPTS):
            if attempt == 0 or not is_serial_line(self._bus.name):
                sent_s, heard = self._publish(period, frames), []
            listened = self._listen(period)
            self._note_version([frame for _, frame in listened])
            heard += listened
            self._is_connected = self._is_connected or self._is_answered(heard)
            if self._is_connected or not self._turn.sync:
                return sent_s, heard
        if self._foreign_version is not None:
            raise BusError(
                f"bus '{self._bus.name}': the ECU speaks {self._foreign_version}; flash it anew"
            )
        raise BusError(f"bus '{self._bus.name}': no ECU answers; {ecu_remedy(self._bus.name)}")

    def _note_version(self, heard: list[Frame]) -> None:
        """Commands of another version are not intact, so that its ECU seems not to answer."""
        for frame in heard:
            if frame.frame_id == self._identity.frame_id:
                identity = Identity.of((self._identity.decode(frame.data) or {}).get)
                self._foreign_version = identity.other_version if identity else None

    def _publish(self, period: int, frames: list[Frame]) -> float:
        sent_s = self._turn.time_s(period)
        for frame in frames:
            self._bus.send(frame)
        return sent_s

    def _listen(self, period: int) -> list[StampedFrame]:
        answers = self._turn.answers(self._bus, period, self._is_last)
        return [(self._turn.time_s(period), frame) for frame in answers]

    def _is_answered(self, heard: list[StampedFrame]) -> bool:
        return any(self._is_last(frame) for _, frame in heard)

    def _is_last(self, frame: Frame) -> bool:
        """Whether it is the charge command that continues from the last one.

        A damaged or repeated one of somebody else must not end the answer: it would leave the plant
        a period ahead of the ECU, with commands that are that much older.
        """
        counter = self._command_counter(frame)
        return counter is not None and self._last_counter in (None, (counter - 1) % COUNTER_MODULUS)

    def _follow(self, frames: list[Frame]) -> None:
        """Keep the counter of the last command.

        After lost frames or a restart of the ECU this costs one wait for an answer.
        """
        for frame in frames:
            counter = self._command_counter(frame)
            if counter is not None:
                self._last_counter = counter

    def _command_counter(self, frame: Frame) -> int | None:
        """Counter of an intact charge command; None for any other frame."""
        if frame.frame_id != self._command.frame_id or not self._command.is_intact(frame.data):
            return None
        return self._command.counter(frame.data)

    def _late_frames(self, period: int) -> list[StampedFrame]:
        """What came too late for the last period; it must not pass for an answer to this one."""
        late = list[StampedFrame]()
        while len(late) < MOST_FRAMES and (frame := self._bus.receive(0.0)) is not None:
            late.append((self._turn.time_s(period), frame))
        return late

    def _frames(self, readings: Readings, request: Request) -> list[Frame]:
        frames = [
            self._electrical.frame({"Current": readings.current_A, "Voltage": readings.voltage_V}),
            self._thermal.frame(
                {
                    "SurfaceTemperature": readings.surface_temperature_K,
                    "CoolantTemperature": readings.coolant_temperature_K,
                }
            ),
            self._coolant.frame({"CoolingPower": readings.cooling_power_W}),
            self._request.frame(
                {
                    "Request": catalog.Request.CHARGE if request.charge else catalog.Request.OFF,
                    "ReferenceCurrent": request.reference_current_A,
                    "PlugInStateOfCharge": request.plug_in_soc,
                }
            ),
        ]
        if request.mode is not None:
            frames.append(
                self._mode.frame({"Mode": request.mode, "TimeToFull": request.time_to_full_s})
            )
        return [*frames, self._sync] if self._turn.sync else frames

    def _answer(self, heard: list[Frame]) -> Answer:
        values: Values = {}
        for frame in heard:
            receiver = self._receivers.get(frame.frame_id)
            if receiver is not None:
                values.update(receiver.accept(frame.data) or {})
            elif frame.frame_id == self._command.frame_id and self._reception.check(frame.data):
                values.update(self._command.decode(frame.data) or {})
        self._faults.take(values)
        is_told = values.get("LatchedFaults") is not None
        return Answer(
            values, self._reception.end_period(), self._faults.latched if is_told else None
        )


def _label(labels: dict[int, str], value: float | None) -> str | None:
    return None if value is None else labels.get(int(value), "unknown")
