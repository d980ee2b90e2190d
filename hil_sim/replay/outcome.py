"""What answers would have meant for the cell: current, charge, faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from hil_sim.bus.catalog import Message
from hil_sim.replay.recording import Answer, Recording
from hil_sim.replay.signals import Signals

_HEARD = (Message.CHARGE_COMMAND, Message.DIAGNOSTICS, Message.DIAGNOSTICS2)
_SECONDS_PER_HOUR = 3600.0


@dataclass(frozen=True)
class Outcome:
    """Commanded currents by period (A, negative while charging; 0 where none came), their charge
    (Ah) and the bits of all faults that were ever active or latched."""

    currents_A: tuple[float, ...]
    charge_Ah: float
    fault_bits: int


def outcome(recording: Recording, signals: Signals, answers: Sequence[Answer]) -> Outcome:
    """Sum up the answers to a recording; each command holds until the next period."""
    wanted = {recording.database[name].frame_id for name in _HEARD}
    currents_A, bits = [], 0
    for answer in answers:
        values = signals.decode(frame for frame in answer if frame.frame_id in wanted)
        currents_A.append(values.get("CommandCurrent") or 0.0)
        bits |= signals.fault_bits(values)
    times_s = [period.time_s for period in recording.periods]
    lengths_s = [after - before for before, after in pairwise(times_s)]
    charge_As = -sum(current * length for current, length in zip(currents_A, lengths_s))
    return Outcome(tuple(currents_A), charge_As / _SECONDS_PER_HOUR + 0.0, bits)
