"""The firmware's end-to-end supervision of one message, for the receivers of what the ECU sends."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from bms.firmware._firmware import ffi, lib

_COUNTER_MASK = 0x0F


@dataclass(frozen=True)
class ReceptionCounts:
    """Frames of a message since the start that were not as they should be, each at most 255."""

    wrong_length: int
    wrong_crc: int
    repeated: int
    lost: int
    reordered: int


class Reception:
    """Checks the frames of one message that the ECU sends and judges them once a period.

    Policy and data ids are those of the CAN database, from the firmware's table. Source: AUTOSAR
    E2E protocol specification, profile 2 and E2E state machine.

    Profile 2 proves no sender: whoever knows the data ids can send intact frames in sequence, but
    cannot hide the true sender beside it. Two intact frames of one counter and different content
    contest a message, until a whole window of periods has passed without such a pair.
    """

    def __init__(self, frame_id: int) -> None:
        """For a protected message; ValueError for any other identifier."""
        table = lib.host_transmitted_messages()
        rows = (table[row] for row in range(lib.host_transmitted_count()))
        message = next((m for m in rows if m.id == frame_id and m.is_protected), None)
        if message is None:
            raise ValueError(f"0x{frame_id:03X} is no protected message of the ECU")
        self._message = message
        self._policy = ffi.addressof(message, "policy")
        self._state = ffi.new("e2e_receiver_t *")
        # Who is ahead by no more frames than may be lost meets the true ones in as many periods.
        self._intact: deque[set[bytes]] = deque([set()], 1 + message.policy.max_delta_counter)
        self._contested_periods = 0
        self.intact: frozenset[bytes] = frozenset()
        """Intact frames of the period that has ended, in sequence or not."""

    def check(self, data: bytes) -> bool:
        """Whether a frame is intact and in sequence; it counts for the period either way."""
        message = self._message
        status = lib.e2e_check(
            self._state,
            data,
            min(len(data), 0xFF),
            message.length,
            message.data_ids,
            message.policy.max_delta_counter,
        )
        if status not in (lib.E2E_WRONG_LENGTH, lib.E2E_WRONG_CRC):
            self._note_intact(data)
        return bool(status == lib.E2E_OK)

    def _note_intact(self, data: bytes) -> None:
        others = (other for intact in self._intact for other in intact)
        counter = data[1] & _COUNTER_MASK
        if any(other[1] & _COUNTER_MASK == counter and other != data for other in others):
            self._contested_periods = 1 + self._policy.window_periods
        self._intact[-1].add(data)

    def end_period(self) -> bool:
        """Whether this period brought a frame to be used: a good one, of a valid message."""
        self._intact.append(set())
        self._contested_periods = max(0, self._contested_periods - 1)
        self.intact = frozenset(self._intact[-2])
        return bool(lib.e2e_supervise(self._state, self._policy).is_usable)

    @property
    def is_contested(self) -> bool:
        """Whether two senders disagreed in the period that has ended, or shortly before."""
        return self._contested_periods > 0

    @property
    def counts(self) -> ReceptionCounts:
        """What was refused so far, by kind."""
        counts = self._state.counts
        return ReceptionCounts(
            counts.wrong_length, counts.wrong_crc, counts.repeated, counts.lost, counts.reordered
        )
