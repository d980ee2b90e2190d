"""A whole control period of the ECU in C: frames in, step, frames out, over a whole charge."""

from __future__ import annotations

import numpy as np

from bms.arrays import Array
from bms.firmware.batches import ChargeBatch
from hil_sim.studies.bench.machine import THIS_PROJECT
from hil_sim.studies.bench.problem import Problem
from hil_sim.studies.bench.race import Peer

COMMAND_TOLERANCE_A = 2.1e-3
"""The recorded commands have passed the bus, which rounds them by up to 2 mA."""


def control_periods(problem: Problem) -> Peer:
    """The recorded charge played to a new ECU; its answers are the commands in A."""
    firmware = problem.firmware
    periods = [[(frame.frame_id, frame.data) for frame in frames] for frames in problem.frames]
    batch = ChargeBatch(firmware.preset, firmware.model, periods)

    def solve() -> Array:
        return batch.run().astype(np.float64)

    return Peer("control period in C", THIS_PROJECT, solve, COMMAND_TOLERANCE_A)


def recorded_commands_A(problem: Problem) -> Array:
    """What the ECU commanded in the recorded charge, period by period."""
    return np.asarray(problem.series.command_A, dtype=float)
