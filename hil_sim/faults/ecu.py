"""Faults inside the ECU: a restart that loses its state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from bms.validation import strict
from hil_sim.faults.base import Fault
from hil_sim.nodes.ecu import EcuLike


@strict
@dataclass(frozen=True, kw_only=True)
class EcuRestarted(Fault):
    """The ECU is down for a while, deaf and silent, and comes back with fresh state."""

    kind: Literal["ecu-restarted"]

    needs_own_ecu = True

    @property
    def where(self) -> str:
        """The ECU, in words."""
        return "ECU"


class RestartableEcu:
    """An ECU that is made anew after each time that it `is_down`."""

    def __init__(self, make: Callable[[], EcuLike], is_down: Callable[[], bool]) -> None:
        self._make = make
        self._is_down = is_down
        self._ecu: EcuLike | None = make()

    def receive(self, frame_id: int, data: bytes) -> None:
        """Pass a frame on to the ECU; one that is down does not hear it."""
        ecu = self._running()
        if ecu is not None:
            ecu.receive(frame_id, data)

    def step(self) -> None:
        """Let the ECU run one control period unless it is down."""
        ecu = self._running()
        if ecu is not None:
            ecu.step()

    def transmit(self) -> Sequence[tuple[int, bytes]]:
        """Frames of this step in order; none from an ECU that is down."""
        ecu = self._running()
        return [] if ecu is None else ecu.transmit()

    def _running(self) -> EcuLike | None:
        if self._is_down():
            self._ecu = None
        elif self._ecu is None:
            self._ecu = self._make()
        return self._ecu


ECU_FAULTS = (EcuRestarted,)
