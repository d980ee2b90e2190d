"""An ECU at the other end of a bus, in place of one in this process."""

from __future__ import annotations

from bms.errors import BusError
from hil_sim.bus.buses import CanBus, Frame
from hil_sim.bus.deadline import Deadline

_ANSWER_TIMEOUT_S = 10.0


class RemoteEcu:
    """An ECU that steps on the SYNC frame among what it receives."""

    def __init__(self, bus: CanBus, last_id: int) -> None:
        """`last_id` is that of the last frame of an answer."""
        self._bus = bus
        self._last_id = last_id

    def receive(self, frame_id: int, data: bytes) -> None:
        """Send it a frame; BusError when the bus fails."""
        self._bus.send(Frame(frame_id, data))

    def step(self) -> None:
        """Do nothing: the SYNC frame that it received was the step."""

    def transmit(self) -> list[tuple[int, bytes]]:
        """Its answer; BusError when none comes or the bus fails."""
        answer: list[tuple[int, bytes]] = []
        deadline = Deadline(_ANSWER_TIMEOUT_S)
        while deadline.left_s > 0.0:
            frame = self._bus.receive(deadline.left_s)
            if frame is None:
                break
            answer.append(frame)
            if frame.frame_id == self._last_id:
                return answer
        raise BusError(f"bus '{self._bus.name}': no answer in {_ANSWER_TIMEOUT_S:g} s")
