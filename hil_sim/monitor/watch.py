"""Listens to a bus and shows what it says, over and over."""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.monitor.listener import Listener
from hil_sim.monitor.model import Snapshot, SystemModel
from hil_sim.nodes.clock import Clock


def watch(
    listener: Listener,
    model: SystemModel,
    clock: Clock,
    refresh_s: float,
    end_s: float,
    is_over: Callable[[], bool],
    show: Callable[[Snapshot], None],
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
