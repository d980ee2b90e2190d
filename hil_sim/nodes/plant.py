"""The plant's side of the bus: publishes measurements and the request, collects the answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from typing import NamedTuple

from bms.errors import BusError
from bms.firmware import ReceptionCounts
from hil_sim.bus import catalog
from hil_sim.bus.buses import CanBus, Frame, ecu_remedy, is_serial_line
from hil_sim.bus.catalog import Message
from hil_sim.bus.database import COUNTER_MODULUS, MessageCodec
from hil_sim.bus.fault_bits import FaultBits
from hil_sim.bus.identity import Identity
from hil_sim.bus.wire import Decoder, Listener, Publisher
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.commands import CommandReceiver
from hil_sim.nodes.turns import MOST_FRAMES, StampedFrame, Turn
from hil_sim.plant.sensors import Readings

CONNECT_ATTEMPTS = 10

PUBLISHED = (
    Message.CELL_ELECTRICAL,
    Message.CELL_THERMAL,
    Message.COOLANT,
    Message.CHARGE_REQUEST,
    Message.CHARGE_MODE,
)
"""The last of them only where a mode is asked for."""
_REPORTS = (
    Message.ESTIMATE,
    Message.DECISION,
    Message.DECISION_MARGINS,
    Message.DIAGNOSTICS,
    Message.NETWORK_DIAGNOSTICS,
    Message.DIAGNOSTICS2,
    Message.PLAN,
    Message.IDENTITY,
    Message.START,
    Message.BOOT_REFUSAL,
)
_STATES = {state.value: state.label for state in catalog.CommandState}
_CONSTRAINTS = {constraint.value: constraint.label for constraint in catalog.ActiveConstraint}

Delivery = Callable[[list[Frame]], list[Frame]]
"""Frames that arrive in place of those that were sent."""
_TIME = itemgetter(0)


class Request(NamedTuple):
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

    def __init__(
        self,
        values: Sequence[float],
        places: Mapping[str, int],
        usable_command_A: float | None,
        latched_faults: int | None,
    ) -> None:
        """Values in the order of `places`, NaN where nothing was said."""
        self._values, self._places = values, places
        self.usable_command_A = usable_command_A
        """Current in A that a charger may supply; None without a command of a valid message."""
        self.latched_faults = latched_faults
        """Bit n for fault n; None where the ECU said nothing."""

    def value(self, signal: str) -> float | None:
        """Value of a signal in the database's unit."""
        try:
            value = self._values[self._places[signal]]
        except KeyError:
            return None
        return value if value == value else None  # noqa: PLR0124 (NaN)

    @property
    def command_A(self) -> float | None:
        """Commanded current in A."""
        return self.value("CommandCurrent")

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
        self._publisher = Publisher([database[name] for name in PUBLISHED])
        self._sync = Frame(database[Message.SYNC].frame_id, b"")
        self._listener = Listener([database[name] for name in _REPORTS])
        self._identity = database[Message.IDENTITY]
        command = database[Message.CHARGE_COMMAND]
        self._command_id = command.frame_id
        self._command = Decoder(command)
        self._silent_command = [math.nan] * len(command.signals)
        self._places = dict(self._listener.places)
        for signal in command.signals:
            self._places[signal.name] = len(self._places)
        self._checked: Frame | None = None
        self._checked_counter: int | None = None
        self._commands = CommandReceiver(command)
        self._faults = FaultBits()
        self._foreign_version: str | None = None
        self._last_counter: int | None = None
        self._is_connected = False
        self._is_answer_late = False

    @property
    def command_counts(self) -> ReceptionCounts:
        """Charge commands that were not as they should be."""
        return self._commands.counts

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
        said = [frame for _, frame in heard]
        commands = self._commands_of(said)
        self._is_answer_late = not any(map(self._is_last, commands))
        if late:
            self._follow(self._commands_of([frame for _, frame in late]))
        self._follow(commands)
        if self._recorder is not None:
            self._record(late, received=True)
            self._recorder.record(sent_s, frames, received=False)
            self._record(heard, received=True)
        return self._answer(self._heard(said))

    def _record(self, stamped: list[StampedFrame], received: bool) -> None:
        """Frames of one time by one call; in virtual time those are all of a period."""
        assert self._recorder is not None
        if stamped and stamped[0][0] == stamped[-1][0]:
            self._recorder.record(stamped[0][0], [frame for _, frame in stamped], received)
            return
        for time_s, group in groupby(stamped, _TIME):
            self._recorder.record(time_s, [frame for _, frame in group], received)

    def _converse(self, period: int, frames: list[Frame]) -> tuple[float, list[StampedFrame]]:
        """When the frames were published last, in s, and what was heard since."""
        sent_s, heard = 0.0, list[StampedFrame]()
        for attempt in range(CONNECT_ATTEMPTS):
            if attempt == 0 or not is_serial_line(self._bus.name):
                sent_s, heard = self._publish(period, frames), []
            listened = self._turn.answers(self._bus, period, self._is_last)
            heard += listened
            if listened and self._turn.sync:
                # What somebody else says ahead of the ECU must not hide what the ECU says.
                heard += self._late_frames(period)
            if not self._is_connected:
                self._note_version([frame for _, frame in listened])
                self._is_connected = any(self._is_last(frame) for _, frame in heard)
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
        self._bus.send(*frames)
        return sent_s

    def _is_last(self, frame: Frame) -> bool:
        """Whether it is the charge command that continues from the last one.

        A damaged or repeated one of somebody else must not end the answer: it would leave the plant
        a period ahead of the ECU, with commands that are that much older.
        """
        counter = self._command_counter(frame)
        return counter is not None and self._last_counter in (None, (counter - 1) % COUNTER_MODULUS)

    def _commands_of(self, frames: list[Frame]) -> list[Frame]:
        command_id = self._command_id
        return [frame for frame in frames if frame[0] == command_id]

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
        if frame.frame_id != self._command_id:
            return None
        if frame is not self._checked:
            is_intact = self._command.is_intact(frame.data)
            self._checked = frame
            self._checked_counter = MessageCodec.counter(frame.data) if is_intact else None
        return self._checked_counter

    def _late_frames(self, period: int) -> list[StampedFrame]:
        """What came too late for the last period; it must not pass for an answer to this one."""
        late = list[StampedFrame]()
        while len(late) < MOST_FRAMES and (frame := self._bus.receive(0.0)) is not None:
            late.append((self._turn.time_s(period), frame))
        return late

    def _frames(self, readings: Readings, request: Request) -> list[Frame]:
        values: list[float | None] = [
            readings.current_A,
            readings.voltage_V,
            readings.surface_temperature_K,
            readings.coolant_temperature_K,
            readings.cooling_power_W,
            catalog.Request.CHARGE if request.charge else catalog.Request.OFF,
            request.reference_current_A,
            request.plug_in_soc,
        ]
        messages = len(PUBLISHED) - 1
        if request.mode is not None:
            values += [request.mode, request.time_to_full_s]
            messages += 1
        frames = self._publisher.frames(values, messages)
        if self._turn.sync:
            frames.append(self._sync)
        return frames

    def _answer(self, heard: list[Frame]) -> Answer:
        values, command = self._listener.hear(heard), self._silent_command
        for _, data in self._commands_of(heard):
            if self._commands.check(data):
                command = self._command.values(data)
        answer = Answer(values + command, self._places, None, None)
        answer.usable_command_A = self._commands.end_period(answer.command_A)
        self._faults.take(answer.value)
        if answer.value("LatchedFaults") is not None:
            answer.latched_faults = self._faults.latched
        return answer


def _label(labels: dict[int, str], value: float | None) -> str | None:
    return None if value is None else labels.get(int(value), "unknown")
