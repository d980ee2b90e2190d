"""The ECU on a bus: carries frames between the bus and an ECU, and tells it when to step.

Imports neither the CAN database nor plotting, so that `bms ecu` starts quickly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

from hil_sim.bus.buses import CanBus, Frame
from hil_sim.bus.catalog import FrameId
from hil_sim.bus.deadline import Deadline
from hil_sim.bus.frame import frames_of
from hil_sim.nodes.clock import Clock
from hil_sim.nodes.punctuality import DEADLINE_PERIODS, Slots

MEASUREMENT_ID = FrameId.CELL_ELECTRICAL
"""What the plant begins a period with."""
PHASE_PERIODS = 20
"""Measurements after which an ECU on its own clock corrects its phase."""

_LONGEST_START_GAPS = 20
"""A bus without a gap for as long is busy with something else than a period."""
_MOST_FRAMES_A_PERIOD = 1000
_MOST_KEPT_FRAMES = 100
_SYNC_ID = int(FrameId.SYNC)


def _any(frame: Frame) -> bool:
    return True


class EcuLike(Protocol):
    """The firmware, or a baseline in its place."""

    def receive(self, frame_id: int, data: bytes) -> None:
        """Take in a frame by its identifier and data."""

    def step(self) -> None:
        """Run one control period on what was received since the last one."""

    def transmit(self) -> Sequence[tuple[int, bytes]]:
        """Frames of this step in order."""
        ...


@runtime_checkable
class BatchEcu(EcuLike, Protocol):
    """An ECU that takes a whole control period by one call."""

    def exchange(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[tuple[int, bytes]]:
        """Receive frames, step, and return what is transmitted."""
        ...


class EcuNode:
    """Connects an ECU to a bus and counts what passes."""

    def __init__(self, bus: CanBus, ecu: EcuLike) -> None:
        self._bus = bus
        self._ecu = ecu
        self._batches = ecu if isinstance(ecu, BatchEcu) else None
        self._taken: list[Frame] = []
        self.frames = 0
        self.steps = 0
        self.slots: Slots | None = None
        """How punctual the steps were; None before the first one that a clock told."""

    def answer(self, timeout_s: float) -> bool:
        """Take in frames until a SYNC has been answered; False when timeout_s pass without."""
        frames = self._bus.gather(_SYNC_ID, _any, timeout_s, _MOST_FRAMES_A_PERIOD)
        if self._batches is None or len(self._taken) + len(frames) >= _MOST_KEPT_FRAMES:
            for frame in frames:
                self._take(frame)
        else:
            self.frames += len(frames)
            self._taken += frames
        if not frames or frames[-1].frame_id != _SYNC_ID:
            return False
        self._step()
        return True

    def run(self, silence_s: float, stopped: Callable[[], bool], poll_s: float = 0.1) -> None:
        """Answer every SYNC until `stopped`, or until silence_s without a frame after the first."""
        self._await_gap(0.5 * poll_s)
        silent_s = 0.0
        while not stopped() and not (self.frames and silent_s >= silence_s):
            frame = self._bus.receive(poll_s)
            if frame is None:
                silent_s += poll_s
                continue
            silent_s = 0.0
            if self._take(frame):
                self._step()

    def run_on_clock(
        self, period_s: float, clock: Clock, silence_s: float, stopped: Callable[[], bool]
    ) -> None:
        """Step once a period by the clock, without SYNC; ends as `run` does.

        The first measurement sets the phase: steps fall midway between two of them. After every
        PHASE_PERIODS the phase follows the most punctual one, so that neither a late first one
        nor clocks that run apart leave periods without any. After a stall the missed periods are
        not caught up, and the phase stays.
        """
        if not self._heard_measurement(period_s, stopped):
            return
        half_s = DEADLINE_PERIODS * period_s
        slots = self.slots = Slots(period_s, clock.now_s() + half_s)
        offsets_s: list[float] = []
        silent_s = 0.0
        while not stopped() and silent_s < silence_s:
            silent_s += period_s
            for _ in range(_MOST_FRAMES_A_PERIOD):
                frame = self._bus.receive(max(0.0, slots.due_s - clock.now_s()))
                if frame is None:
                    break
                if frame.frame_id == MEASUREMENT_ID:
                    offsets_s.append(clock.now_s() + half_s - slots.due_s)
                self._take(frame)
                silent_s = 0.0
            clock.sleep_until_s(slots.due_s)
            now_s = clock.now_s()
            slots.skip_past(now_s)
            slots.begin(now_s)
            self._step()
            if len(offsets_s) >= PHASE_PERIODS:
                slots.start_s += min(offsets_s)
                offsets_s.clear()

    def _take(self, frame: Frame) -> bool:
        self.frames += 1
        if self._batches is None:
            self._ecu.receive(frame.frame_id, frame.data)
        else:
            self._taken.append(frame)
            if len(self._taken) >= _MOST_KEPT_FRAMES:
                self._hand_on(self._batches)
        return frame.frame_id == _SYNC_ID

    def _hand_on(self, ecu: EcuLike) -> None:
        """Frames of a stream without SYNC must not pile up."""
        for kept in self._taken:
            ecu.receive(kept.frame_id, kept.data)
        self._taken.clear()

    def _step(self) -> None:
        if self._batches is None:
            self._ecu.step()
            answers = self._ecu.transmit()
        else:
            answers = self._batches.exchange(self._taken)
            self._taken.clear()
        self.steps += 1
        self._bus.send(*frames_of(answers))

    def _heard_measurement(self, poll_s: float, stopped: Callable[[], bool]) -> bool:
        while not stopped():
            if (frame := self._bus.receive(poll_s)) is not None:
                self._take(frame)
                if frame.frame_id == MEASUREMENT_ID:
                    return True
        return False

    def _await_gap(self, gap_s: float) -> None:
        """Let a period that began before the ECU listened pass, so that the first one is whole."""
        deadline = Deadline(_LONGEST_START_GAPS * gap_s)
        while deadline.left_s > 0.0:
            if self._bus.receive(gap_s) is None:
                return
