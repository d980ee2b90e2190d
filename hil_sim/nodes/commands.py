"""The charger's end of the bus: what it makes of all that claims to be the ECU's command."""

from __future__ import annotations

from bms.firmware import Reception, ReceptionCounts
from hil_sim.bus.database import MessageCodec


class CommandReceiver:
    """Takes charge commands; once a period says what the charger may supply.

    The end-to-end protection proves no sender. So of several intact commands of a period the
    weakest is obeyed, whichever of them is in sequence, and none of senders that contradict
    each other: somebody else can end a charge, but not strengthen it while the ECU is heard.
    """

    def __init__(self, codec: MessageCodec) -> None:
        self._codec = codec
        self._reception = Reception(codec.frame_id)

    @property
    def counts(self) -> ReceptionCounts:
        """Commands that were not as they should be."""
        return self._reception.counts

    def check(self, data: bytes) -> bool:
        """Whether a command is intact and in sequence; it counts for the period either way."""
        return self._reception.check(data)

    def end_period(self, command_A: float | None) -> float | None:
        """Current in A that the charger may supply; None without a command that it may use.

        `command_A` is what the last command in sequence says, None for one that says nothing.
        """
        is_usable = self._reception.end_period()
        if self._reception.is_contested:
            return 0.0
        if not is_usable or command_A is None or len(self._reception.intact) == 1:
            return command_A if is_usable else None
        told_A = [
            (self._codec.decode(data) or {}).get("CommandCurrent")
            for data in self._reception.intact
        ]
        return max(command_A, *[0.0 if told is None else told for told in told_A])
