"""A running bus as the page shows it: a thread that listens, and what is known as JSON."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from bms.errors import BusError
from hil_sim.bus.closing import Closing
from hil_sim.bus.database import load_codecs
from hil_sim.dashboard.page_data import limits_data
from hil_sim.fault_matrix.matrix import fault_numbers
from hil_sim.monitor.listener import Listener
from hil_sim.monitor.model import Snapshot, SystemModel
from hil_sim.monitor.presets import PresetFinder
from hil_sim.nodes.clock import Clock

_LISTEN_S = 0.1
_FIRST_WAIT_S = 0.5
_LONGEST_WAIT_S = 8.0


class BusFeed(Closing):
    """Listens to a bus from its making on; nothing is ever sent.

    A bus that is lost is opened again, after longer and longer waits.
    """

    def __init__(self, bus: str, finder: PresetFinder, clock: Clock) -> None:
        """BusError in one line when the bus cannot be opened."""
        self._bus = bus
        self._listener: Listener | None = Listener(bus)
        self._finder = finder
        self._clock = clock
        self._start_s = clock.now_s()
        self._model = SystemModel(load_codecs())
        self._lock = threading.Lock()
        self._error: str | None = None
        self._is_closed = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def message(self) -> dict[str, Any]:
        """What is known now, or why nothing is heard any more."""
        error = self._error
        if error is not None:
            return {"error": error}
        with self._lock:
            now_s = self._clock.now_s()
            snapshot, frames = self._model.snapshot(now_s), self._model.frames
        in_force = self._finder.find(snapshot.identity, snapshot.refusal)
        preset = in_force.preset
        return {
            "snapshot": {"time_s": now_s - self._start_s, "frames": frames, **_data(snapshot)},
            "limits": None if preset is None else limits_data(preset),
            "remark": "; ".join(
                text for text in (in_force.remark, snapshot.restarts, snapshot.refusal) if text
            ),
            "silence_s": snapshot.silence_s,
            "is_silent": snapshot.is_silent,
        }

    def close(self) -> None:
        """End listening and close the connection to the bus."""
        self._is_closed.set()
        self._thread.join()
        if self._listener is not None:
            self._listener.close()

    def _listen(self) -> None:
        wait_s = _FIRST_WAIT_S
        while not self._is_closed.is_set():
            try:
                if self._listener is None:
                    self._listener = Listener(self._bus)
                frame = self._listener.receive(_LISTEN_S)
            except BusError as error:
                self._lose(error)
                self._is_closed.wait(wait_s)
                wait_s = min(2.0 * wait_s, _LONGEST_WAIT_S)
                continue
            self._error = None
            if frame is not None:
                wait_s = _FIRST_WAIT_S
                with self._lock:
                    self._model.take(self._clock.now_s(), frame)

    def _lose(self, error: BusError) -> None:
        self._error = str(error)
        if self._listener is not None:
            with suppress(BusError, OSError):
                self._listener.close()
            self._listener = None


def _data(snapshot: Snapshot) -> dict[str, Any]:
    return {
        "readings": {
            name: None if reading.is_stale else reading.value
            for name, reading in snapshot.readings.items()
        },
        "active": _names(snapshot, "ActiveFaults"),
        "latched": _names(snapshot, "LatchedFaults"),
        "messages": [
            {"id": traffic.frame_id} | _without(asdict(traffic), "frame_id")
            for traffic in snapshot.messages
        ],
        "foreign": snapshot.foreign.frames,
    }


def _names(snapshot: Snapshot, signal: str) -> list[str] | None:
    bits = snapshot.fault_bits[signal]
    if bits is None or snapshot.readings[signal].value is None:
        return None
    return [name for name, number in fault_numbers().items() if bits >> number & 1]


def _without(values: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key != name}
