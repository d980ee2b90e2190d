"""A pack's plant on a bus, in lock step with whatever ECU answers."""

from __future__ import annotations

from collections.abc import Callable

from bms.errors import BusError
from hil_sim.bus.buses import CanBus, Frame
from hil_sim.logs.recorder import Recorder
from hil_sim.nodes.plant import CONNECT_ATTEMPTS, Delivery
from hil_sim.nodes.turns import MOST_FRAMES
from hil_sim.studies.pack._pack import lib

COMMAND_ID: int = lib.pack_command_id()
"""What an ECU's step ends with."""


class PackPlantNode:
    """Publishes a period and gathers its answer. Time stamps are virtual."""

    def __init__(
        self,
        bus: CanBus,
        period_s: float,
        answer_timeout_s: float,
        serve: Callable[[], object] | None = None,
        recorder: Recorder | None = None,
        sent: Delivery = list,
    ) -> None:
        """`serve` lets an ECU in the same thread answer; `sent` says what arrives of the frames."""
        self._bus, self._serve, self._recorder, self._sent = bus, serve, recorder, sent
        self._period_s, self._timeout_s = period_s, answer_timeout_s
        self._is_connected = False

    def exchange(self, period: int, published: list[Frame]) -> list[Frame]:
        """Frames that the ECU answers in a period; empty when it is silent.

        Until an ECU has answered for the first time the period is offered again, so that it may
        start later. Raises BusError when none comes.
        """
        frames = self._sent(published)
        for _ in range(CONNECT_ATTEMPTS):
            self._bus.send(*frames)
            if self._serve is not None:
                self._serve()
            heard = self._bus.gather(COMMAND_ID, _ends_a_step, self._timeout_s, MOST_FRAMES)
            self._is_connected = self._is_connected or any(f[0] == COMMAND_ID for f in heard)
            if self._is_connected:
                break
        else:
            raise BusError(
                f"bus '{self._bus.name}': no ECU of a pack answers; "
                f"start 'bms ecu --bus {self._bus.name}' with the same --cells"
            )
        if self._recorder is not None:
            time_s = period * self._period_s
            self._recorder.record(time_s, frames, received=False)
            self._recorder.record(time_s, heard, received=True)
        return heard


def _ends_a_step(frame: Frame) -> bool:
    return True
