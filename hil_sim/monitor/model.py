"""The state of a running system as its frames tell it, without a clock or a screen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bms.image import foreign_content, shipped_contents
from codegen import can_database
from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import Message, ResetCause
from hil_sim.bus.database import MessageCodec, Values
from hil_sim.bus.fault_bits import FaultBits
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.bus.identity import Identity
from hil_sim.bus.refusal import refusal_text
from hil_sim.monitor.traffic import ForeignMeter, ForeignTraffic, MessageMeter, MessageTraffic

COUNTS = ("WrongCrcFrames", "WrongLengthFrames", "RepeatedFrames", "LostFrames", "ReorderedFrames")
MOST_COUNTED = 255
"""A count that stands for itself or more."""


@dataclass(frozen=True)
class Reading:
    """A signal's last value; None when it is not available or has not come yet."""

    value: float | None = None
    is_stale: bool = False


@dataclass(frozen=True)
class ReceiverReport:
    """What the ECU says of a message that it receives: E2E state and the COUNTS since its start."""

    frame_id: int
    name: str
    state: str | None
    counts: tuple[int, ...]
    is_stale: bool


@dataclass(frozen=True)
class Snapshot:
    """Everything that is known at a time."""

    silence_s: float | None
    """Time without a good frame of the database in s; None before the first one."""
    is_silent: bool
    """Whether that is longer than any of the fast messages may be away."""
    readings: Mapping[str, Reading]
    messages: tuple[MessageTraffic, ...]
    receivers: tuple[ReceiverReport, ...]
    foreign: ForeignTraffic
    identity: Identity | None
    fault_bits: Mapping[str, int | None]
    """Bits of all faults, of those in later messages too, as ActiveFaults and LatchedFaults."""
    choices: Mapping[str, Mapping[int, str]]

    def name(self, signal: str) -> str | None:
        """Name of a signal's value, or None when it is not available."""
        value = self.readings[signal].value
        return None if value is None else self.choices[signal].get(int(value), f"{value:g}")

    def faults(self, signal: str) -> list[str] | None:
        """Names of the faults whose bits are set in ActiveFaults or LatchedFaults."""
        bits = self.fault_bits[signal]
        if bits is None or self.readings[signal].value is None:
            return None
        names = self.choices["FirstFault"]
        return [names.get(n, str(n)) for n in range(bits.bit_length()) if bits >> n & 1]

    def message(self, name: str) -> MessageTraffic:
        """Traffic of the message of that name."""
        return next(message for message in self.messages if message.name == name)

    @property
    def refusal(self) -> str | None:
        """Why the ECU's boot stage does not start its application; None where it does not say."""
        part, check = self.readings["RefusedPart"], self.readings["FailedCheck"]
        if part.is_stale or (part.value is None and check.value is None):
            return None
        return refusal_text(part.value, check.value)

    @property
    def foreign_content(self) -> str | None:
        """What is wrong with the content of the ECU's calibration, if anything is known to be.

        Nothing is until somebody has made the shipped contents, for which a screen does not wait.
        """
        if not shipped_contents.cache_info().currsize:
            return None
        content = self.readings["CalibrationContent"].value
        if self.identity is None or content is None:
            return None
        known = self.identity
        return foreign_content(known.model_hash, known.preset_hash, int(content))

    @property
    def restarts(self) -> str | None:
        """Why and how often in a row the ECU has started; None for a start with the power."""
        cause, count = self.readings["ResetCause"].value, self.readings["ResetCount"].value
        if cause in (None, ResetCause.POWER_ON, ResetCause.NOT_AVAILABLE) or count is None:
            return None
        return f"the ECU has restarted, {count:g} in a row: {self.name('ResetCause')}"

    @property
    def is_lock_step(self) -> bool:
        """Whether a SYNC starts each period."""
        sync = self.message(Message.SYNC)
        return sync.age_s is not None and not sync.is_stale


class SystemModel:
    """Takes frames with the time at which they came; times in s must not run backwards."""

    def __init__(self, database: Mapping[str, MessageCodec]) -> None:
        parsed = can_database.load_database()
        self._meters = {
            message.frame_id: MessageMeter(
                database[message.name],
                1e-3 * can_database.number_attribute(parsed, message, can_database.CYCLE_ATTRIBUTE),
            )
            for message in parsed.messages
        }
        self._choices = {
            signal: names for codec in database.values() for signal, names in codec.choices.items()
        }
        self._ids = {codec.name: codec.frame_id for codec in database.values()}
        self._shortest_stale_s = min(meter.stale_s for meter in self._meters.values())
        self._foreign = ForeignMeter()
        self._faults = FaultBits()
        self._reports: dict[int, tuple[float, Values]] = {}
        self.frames = 0

    def take(self, time_s: float, frame: Frame | ForeignFrame) -> None:
        """Count a frame and keep what it says."""
        self.frames += 1
        meter = self._meters.get(frame.frame_id) if isinstance(frame, Frame) else None
        if meter is None or isinstance(frame, ForeignFrame):
            self._foreign.take(time_s, frame)
            return
        values = meter.take(time_s, frame.data)
        self._faults.take((values or {}).get)
        if values is not None and meter.codec.name == Message.NETWORK_DIAGNOSTICS:
            self._reports[_whole(values["ReportedMessage"])] = time_s, values

    def snapshot(self, now_s: float) -> Snapshot:
        """What is known at a time in s, not before that of the last frame."""
        traffic = {id_: meter.traffic(now_s) for id_, meter in self._meters.items()}
        readings: dict[str, Reading] = {}
        for frame_id, meter in self._meters.items():
            is_stale = traffic[frame_id].is_stale
            for signal in meter.codec.signal_names:
                readings[signal] = Reading(meter.values.get(signal), is_stale)
        ages_s = [message.age_s for message in traffic.values() if message.age_s is not None]
        silence_s = min(ages_s, default=None)
        return Snapshot(
            silence_s=silence_s,
            is_silent=silence_s is not None and silence_s > self._shortest_stale_s,
            readings=readings,
            messages=tuple(traffic.values()),
            receivers=tuple(
                self._receiver(number, name, now_s)
                for number, name in sorted(self._choices["ReportedMessage"].items())
            ),
            foreign=self._foreign.traffic(now_s),
            identity=Identity.of(lambda signal: readings[signal].value),
            fault_bits={
                "ActiveFaults": self._faults.active,
                "LatchedFaults": self._faults.latched,
            },
            choices=self._choices,
        )

    def _receiver(self, number: int, name: str, now_s: float) -> ReceiverReport:
        time_s, values = self._reports.get(number, (now_s, {}))
        stale_s = self._meters[self._ids[Message.NETWORK_DIAGNOSTICS]].stale_s
        state = values.get("ReportedState")
        return ReceiverReport(
            frame_id=self._ids[name],
            name=name,
            state=None
            if state is None
            else self._choices["ReportedState"].get(int(state), f"{state:g}"),
            counts=tuple(_whole(values[count]) for count in COUNTS) if values else (),
            # The messages take turns in being reported.
            is_stale=now_s - time_s > stale_s * len(self._choices["ReportedMessage"]),
        )


def _whole(value: float | None) -> int:
    return int(value or 0)
