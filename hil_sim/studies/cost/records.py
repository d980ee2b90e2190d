"""What the counting program reads and writes (firmware_c/cost/cost.c)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bms.arrays import IntArray
from hil_sim.bus.buses import Frame

ESTIMATOR_INPUTS = 8
MOST_FRAMES = 5
_RESTART, _PERIOD, _STATE = range(3)
_FRAME = struct.Struct("<IB8s3x")
_STATE_CONTENT = struct.Struct("<8f9f")
_CONTENT_BYTES = max(MOST_FRAMES * _FRAME.size, _STATE_CONTENT.size)
_COUNTERS = 5

# 25 MHz timer, and 2^6 ns of the emulator's time for each instruction.
TICK_NS, INSTRUCTION_SHIFT = 40, 6


class State(NamedTuple):
    """Inputs of an estimate and of a decision; temperatures in K."""

    current_A: float
    cooling_power_W: float
    surface_temperature_K: float
    coolant_temperature_K: float
    core_temperature_K: float
    soc: float
    reference_current_A: float


class Counts(NamedTuple):
    """Instructions, (N,) each; of a single state the period is 0, without a family the
    observation.
    """

    estimate: IntArray
    observation: IntArray
    decision: IntArray
    period: IntArray

    @property
    def together(self) -> IntArray:
        """Of what leads from the readings to a current."""
        return self.estimate + self.observation + self.decision


def restart() -> bytes:
    """Record that makes the ECU start anew."""
    return _record(_RESTART, b"")


def period(frames: Sequence[Frame]) -> bytes:
    """A control period with the frames that the ECU receives in it; ValueError for too many."""
    if len(frames) > MOST_FRAMES:
        raise ValueError(f"a period has at most {MOST_FRAMES} frames, not {len(frames)}")
    content = b"".join(_FRAME.pack(f.frame_id, len(f.data), f.data) for f in frames)
    return _record(_PERIOD, content, len(frames))


def state(state: State) -> bytes:
    """Record of an estimate and of a decision on one state, each for itself.

    The decision does not take the estimate; filtered inputs are 0.
    """
    measured = (
        state.current_A,
        state.cooling_power_W,
        state.surface_temperature_K,
        state.coolant_temperature_K,
    )
    inputs = (*measured, *[0.0] * (ESTIMATOR_INPUTS - len(measured)))
    temperatures = (
        *(state.core_temperature_K, 0.0),
        *(state.surface_temperature_K, 0.0),
        *(state.coolant_temperature_K, 0.0),
    )
    others = (state.cooling_power_W, state.soc, state.reference_current_A)
    return _record(_STATE, _STATE_CONTENT.pack(*inputs, *temperatures, *others))


def counts(results: bytes) -> Counts:
    """Instructions from the ticks that the program wrote."""
    ticks = np.frombuffer(results, "<u4").astype(np.int64).reshape(-1, _COUNTERS)
    instructions = np.rint((ticks[:, 1:] - ticks[:, :1]) * TICK_NS / 2**INSTRUCTION_SHIFT)
    return Counts(*np.maximum(instructions, 0.0).astype(np.int64).T)


def _record(kind: int, content: bytes, frames: int = 0) -> bytes:
    return struct.pack("<II", kind, frames) + content.ljust(_CONTENT_BYTES, b"\0")
