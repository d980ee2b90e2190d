"""The firmware's end-to-end supervision of one message, for the receivers of what the ECU sends."""

from __future__ import annotations

from dataclasses import dataclass

from bms.firmware._firmware import ffi, lib


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
        return bool(status == lib.E2E_OK)

    def end_period(self) -> bool:
        """Whether this period brought a frame to be used: a good one, of a valid message."""
        return bool(lib.e2e_supervise(self._state, self._policy).is_usable)

    @property
    def counts(self) -> ReceptionCounts:
        """What was refused so far, by kind."""
        counts = self._state.counts
        return ReceptionCounts(
            counts.wrong_length, counts.wrong_crc, counts.repeated, counts.lost, counts.reordered
        )
