"""Listens to a bus and shows what it says, over and over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from hil_sim.bus.buses import Frame
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.monitor.listener import Listener
from hil_sim.nodes.clock import Clock

Known = TypeVar("Known")
Known_co = TypeVar("Known_co", covariant=True)


class Model(Protocol[Known_co]):
    """Takes frames with the times at which they came, and says what is known at a time."""

    def take(self, time_s: float, frame: Frame | ForeignFrame) -> None:
        """Count a frame and keep what it says."""
        ...

    def snapshot(self, now_s: float) -> Known_co:
        """What is known at a time in s."""
        ...


def watch(
    listener: Listener,
    model: Model[Known],
    clock: Clock,
    refresh_s: float,
    end_s: float,
    is_over: Callable[[], bool],
    show: Callable[[Known], None],
) -> None:
    """Show a snapshot at once, after each refresh_s, and at end_s; BusError when the bus fails.

    Ends at end_s or when is_over. A bus that is never quiet does not delay the next snapshot.
    """
    due_s = clock.now_s()
    while not is_over():
        while (left_s := due_s - clock.now_s()) > 0.0:
            frame = listener.receive(left_s)
            if frame is not None:
                model.take(clock.now_s(), frame)
        show(model.snapshot(clock.now_s()))
        if clock.now_s() >= end_s:
            return
        due_s = min(max(due_s + refresh_s, clock.now_s()), end_s)
