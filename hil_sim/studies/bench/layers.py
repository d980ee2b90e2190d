"""What a simulation spends its time on: a sample of the stack every millisecond."""

from __future__ import annotations

import signal
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from types import FrameType

from hil_sim.studies.bench.breakdown import REST

INTERVAL_S = 0.001

BUS = "bus (python-can)"
LAYERS: Mapping[str, tuple[str, ...]] = {
    "cell model": ("bms/cell/", "hil_sim/plant/plant.py", "hil_sim/plant/disturbances.py"),
    BUS: ("hil_sim/bus/buses.py", "hil_sim/bus/batches.py", "hil_sim/bus/deadline.py"),
    "measurements to protected frames": (
        "wire.py:frames",
        "wire.py:<listcomp>",
        "plant.py:_frames",
    ),
    "answer: protection, values": (
        "hil_sim/bus/wire.py",
        "hil_sim/bus/database.py",
        "hil_sim/bus/fault_bits.py",
        "hil_sim/nodes/commands.py",
        "bms/firmware/reception.py",
        "plant.py:_answer",
        "plant.py:value",
    ),
    "lock step of the plant's node": ("hil_sim/nodes/plant.py", "hil_sim/nodes/turns.py"),
    "recording": ("hil_sim/logs/",),
    "firmware": ("bms/firmware/",),
    "firmware's node": ("hil_sim/nodes/ecu.py",),
    "sensors": ("hil_sim/plant/sensors.py",),
    "time series": ("hil_sim/run/result.py",),
    "charge: charger, request, end": ("hil_sim/run/charge.py", "hil_sim/plant/charger.py"),
}
"""Ends of `file:function` or parts of the path, of which the first that fits counts."""


class LayerCounts:
    """How often each layer was at work; a sample belongs to the innermost layer on the stack."""

    def __init__(self) -> None:
        self._samples: Counter[str] = Counter()
        self._unsettled: list[str] = []

    def note(self, frame: FrameType | None) -> None:
        """Count one sample of the stack for the innermost layer on it."""
        while frame is not None:
            layer = _layer_of(frame.f_code.co_filename, frame.f_code.co_name)
            if layer is not None:
                self._unsettled.append(layer)
                return
            frame = frame.f_back
        self._unsettled.append(REST)

    def settle(self) -> None:
        """A period is over: what was sampled in it counts. What comes after the last does not."""
        if self._unsettled:
            self._samples.update(self._unsettled)
            self._unsettled.clear()

    def forget(self) -> None:
        """Forget all samples, such as those from before the first answer."""
        self._samples.clear()
        self._unsettled.clear()

    @property
    def shares_percent(self) -> dict[str, float]:
        """Share of the time by layer, largest first."""
        total = sum(self._samples.values())
        return {name: 100.0 * n / total for name, n in self._samples.most_common()}


@cache
def _layer_of(file: str, function: str) -> str | None:
    place = f"{file}:{function}".replace("\\", "/")
    for layer, parts in LAYERS.items():
        if any(part in place for part in parts):
            return layer
    return None


@contextmanager
def sampled() -> Iterator[LayerCounts]:
    """Take samples of the main thread meanwhile, by the wall clock, so that waiting counts too."""
    counts = LayerCounts()
    before = signal.signal(signal.SIGALRM, lambda _, frame: counts.note(frame))
    signal.setitimer(signal.ITIMER_REAL, INTERVAL_S, INTERVAL_S)
    try:
        yield counts
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
