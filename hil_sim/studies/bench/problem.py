"""The states of a whole charge, which every benchmarked way has to give the same answers for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bms.arrays import Array
from bms.barrier import barrier_constants, sampling_margins
from bms.barrier.constraints import current_interval_A, left_hand_sides, thermal_sides
from bms.cell import CellState
from bms.firmware import Firmware
from hil_sim.bus.buses import Frame
from hil_sim.logs.recorder import PeriodRecorder
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.result import TimeSeries
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from hil_sim.studies.bench.race import Rows

_BUS = "virtual:bench-problem"
_WIDTH_A = 1e-3


@dataclass(frozen=True)
class Problem:
    """N states in the order of the charge.

    `inputs` (N, 4) are the estimator's and `core_temperature_K` its answers. `states` with
    `cooling_power_W` are the decision's, `lower_A` and `upper_A` (N,) the currents that its
    constraints leave, of which the lower one is the answer; `quadratics` (N, 6, 3) are the
    left-hand sides as constant, linear and square coefficient over the current. All this is
    computed in double precision by bms.kan and bms.barrier, independently of the C code.
    """

    firmware: Firmware
    inputs: Array
    core_temperature_K: Array
    states: CellState
    cooling_power_W: Array
    reference_current_A: float
    lower_A: Array
    upper_A: Array
    quadratics: Array
    frames: list[list[Frame]]
    """What the ECU is sent in each period of the charge, in order of time."""
    series: TimeSeries

    def sample(self, count: int) -> Rows:
        """Numbers of `count` rows, evenly from all over the charge."""
        return np.linspace(0, len(self.lower_A) - 1, count).astype(np.int64)


def charge_problem(preset: str, max_time_s: float = 3600.0, seed: int = 0) -> Problem:
    """The problem of a disturbed charge in closed loop with the preset's own model."""
    firmware = Firmware(preset)
    settings = Settings(
        firmware.preset,
        bus=_BUS,
        seed=seed,
        disturbance=DisturbanceKind.BANG_BANG,
        max_time_s=max_time_s,
    )
    sent = PeriodRecorder()
    series = run_both(settings, sent).series
    return _problem(firmware, series, sent.periods)


def _problem(firmware: Firmware, series: TimeSeries, frames: list[list[Frame]]) -> Problem:
    preset, model = firmware.preset, firmware.model
    power_W = preset.initial.cooling_power_W
    columns: list[Array] = [
        np.asarray(series.current_A),
        np.full(len(series.time_s), power_W),
        np.asarray(series.surface_temperature_K),
        np.asarray(series.coolant_temperature_K),
    ]
    inputs = _as_float32(np.column_stack(columns))
    core_K, in_domain = model.network.evaluate(inputs)
    state = CellState(
        _as_float32(np.asarray(series.soc)),
        core_K,
        inputs[:, 2],
        inputs[:, 3],
    )
    lower_A, upper_A, quadratics = _constraints(firmware, state, power_W)
    chosen = in_domain & (upper_A - lower_A > _WIDTH_A)
    return Problem(
        firmware,
        inputs[chosen],
        core_K[chosen],
        CellState(*(column[chosen] for column in state)),
        inputs[chosen, 1],
        preset.limits.reference_current_A,
        lower_A[chosen],
        upper_A[chosen],
        quadratics[chosen],
        frames,
        series,
    )


def _as_float32(values: Array) -> Array:
    """The firmware is given no more, and the reference has to answer the same question."""
    return values.astype(np.float32).astype(np.float64)


def _constraints(
    firmware: Firmware, state: CellState, power_W: float
) -> tuple[Array, Array, Array]:
    preset, bound_K = firmware.preset, firmware.model.error_bound_K
    cell, constants = preset.cell, barrier_constants(preset.cell, preset)
    margins = sampling_margins(cell, preset)
    lower_A, upper_A = current_interval_A(cell, preset, constants, margins, state, power_W, bound_K)
    rest = left_hand_sides(cell, preset, constants, state, power_W, 0.0)
    sides: list[tuple[Any, Any, Any]] = [
        (0.0, cell.ohmic_resistance_ohm, rest.voltage_V - margins.voltage_V),
        (0.0, 1.0 / cell.capacity_As, rest.soc_per_s - margins.soc_per_s),
        *thermal_sides(cell, preset, constants, margins, rest, state.core_temperature_K, bound_K),
    ]
    rows = [
        np.stack(np.broadcast_arrays(constant, slope, -square), axis=-1)
        for square, slope, constant in sides
    ]
    return lower_A, upper_A, np.stack(rows, axis=1)
