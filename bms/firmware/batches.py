"""The firmware's work on many inputs by one call of C, for measurements of its speed.

Everything is prepared when a batch is made; `run` is the work alone. What it returns is overwritten
by the next run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bms.arrays import Array, Float32Array
from bms.firmware._firmware import ffi, lib
from bms.firmware.calibration import calibration_block
from bms.firmware.controller import write_decision_input
from bms.model.model_file import KanModel
from bms.presets import Preset


class EstimateBatch:
    """Core temperature estimates for rows of inputs (N, n_in)."""

    def __init__(self, preset: Preset, model: KanModel, inputs: Array) -> None:
        self._block = calibration_block(preset, model, compiled_in=True)
        self._inputs = np.ascontiguousarray(inputs, dtype=np.float32)
        self._core_K = np.empty(len(self._inputs), np.float32)
        self._in_domain = np.empty(len(self._inputs), np.uint8)
        self._arguments = (
            ffi.addressof(self._block.kan),
            ffi.from_buffer("float[]", self._inputs),
            len(self._inputs),
            ffi.from_buffer("float[]", self._core_K, require_writable=True),
            ffi.from_buffer("uint8_t[]", self._in_domain, require_writable=True),
        )

    def run(self) -> Float32Array:
        """Core temperatures in K, (N,)."""
        lib.host_estimate_rows(*self._arguments)
        return self._core_K


class DecisionBatch:
    """Decisions for N states, each with the arguments of Firmware.solve."""

    def __init__(
        self, preset: Preset, model: KanModel, states: Sequence[Mapping[str, float]]
    ) -> None:
        self._block = calibration_block(preset, model, compiled_in=True)
        self._inputs = ffi.new("rcbf_input_t[]", len(states))
        for target, state in zip(self._inputs, states):
            write_decision_input(target, **state)
        self._current_A = np.empty(len(states), np.float32)
        self._output = ffi.from_buffer("float[]", self._current_A, require_writable=True)

    def run(self) -> Float32Array:
        """Currents in A, (N,)."""
        constants, count = ffi.addressof(self._block.rcbf), len(self._inputs)
        lib.host_decide_rows(constants, self._inputs, count, self._output)
        return self._current_A


class ChargeBatch:
    """Control periods of a new ECU that receives the same number of frames in each."""

    def __init__(
        self, preset: Preset, model: KanModel, periods: Sequence[Sequence[tuple[int, bytes]]]
    ) -> None:
        """Frames of each period as identifier and data; ValueError when their numbers differ."""
        if len({len(frames) for frames in periods}) != 1:
            raise ValueError("periods must have the same number of frames, at least one of them")
        self._block = calibration_block(preset, model, compiled_in=True)
        self._config = ffi.new("bms_config_t *", {"calibration": self._block})
        self._state = ffi.new("bms_t *")
        self._frames_a_period, self._count = len(periods[0]), len(periods)
        self._frames: Any = ffi.new("can_frame_t[]", self._frames_a_period * self._count)
        sent = (frame for frames in periods for frame in frames)
        for target, (frame_id, data) in zip(self._frames, sent):
            target.id, target.length = frame_id, len(data)
            ffi.memmove(target.data, data, len(data))
        self._command_A = np.empty(self._count, np.float32)
        self._output = ffi.from_buffer("float[]", self._command_A, require_writable=True)

    def run(self) -> Float32Array:
        """Commanded currents in A, period by period."""
        lib.bms_init(self._state, self._config)
        lib.host_run_periods(
            self._state, self._frames, self._frames_a_period, self._count, self._output
        )
        return self._command_A
