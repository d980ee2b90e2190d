"""A whole control period of the ECU in C: frames in, step, frames out, over a whole charge."""

from __future__ import annotations

import numpy as np
from bms.firmware._firmware import ffi, lib

from bms.arrays import Array
from bms.firmware.calibration import calibration_block
from hil_sim.studies.bench.machine import THIS_PROJECT
from hil_sim.studies.bench.problem import Problem
from hil_sim.studies.bench.race import Peer

COMMAND_TOLERANCE_A = 2.1e-3
"""The recorded commands have passed the bus, which rounds them by up to 2 mA."""


def control_periods(problem: Problem) -> Peer:
    """The recorded charge played to a new ECU; its answers are the commands in A."""
    firmware, periods = problem.firmware, problem.frames
    block = calibration_block(firmware.preset, firmware.model, compiled_in=True)
    config = ffi.new("bms_config_t *", {"calibration": block})
    state = ffi.new("bms_t *")
    received = ffi.new("can_frame_t[]", sum(map(len, periods)))
    for target, frame in zip(received, (frame for frames in periods for frame in frames)):
        target.id, target.length = frame.frame_id, len(frame.data)
        ffi.memmove(target.data, frame.data, len(frame.data))
    command_A = np.empty(len(periods), np.float32)
    output = ffi.from_buffer("float[]", command_A, require_writable=True)

    def solve() -> Array:
        lib.bms_init(state, config)
        lib.host_run_periods(state, received, len(periods[0]), len(periods), output)
        return command_A.astype(np.float64)

    return Peer("control period in C", THIS_PROJECT, solve, COMMAND_TOLERANCE_A)


def recorded_commands_A(problem: Problem) -> Array:
    """What the ECU commanded in the recorded charge, period by period."""
    return np.asarray(problem.series.command_A, dtype=float)
