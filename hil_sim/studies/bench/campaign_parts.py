"""What a run of a campaign takes time for, each part timed alone on the numbers of the same run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from bms.arrays import Array
from bms.model.pair import load_pair
from hil_sim.native._native import ffi, lib
from hil_sim.native.cell_fields import cell_fields
from hil_sim.plant.disturbances import knot_bounds
from hil_sim.plant.true_cell import TrueCell
from hil_sim.studies.bench.race import ClockNs
from hil_sim.studies.campaign.draws import draw
from hil_sim.studies.campaign.engine import (
    CONTROLLERS,
    SUB_STEPS,
    CampaignCharge,
    Scenario,
    limit_slope,
)
from hil_sim.studies.campaign.noise import knot_blocks, streams
from hil_sim.studies.campaign.rows import FIRMWARE, Row, row
from hil_sim.studies.campaign.settings import CampaignSettings
from hil_sim.studies.campaign.worker import BLOCK_PERIODS, run_one

_MS_PER_NS = 1e-6
CELL_PART = "cells of the three charges"
FIRMWARE_PART = "firmware, its frames and its readings"
WATCH_PART = "watch over the error of the firmware's model"
_BASELINES = "S-CBF and CC-CV with their readings"
_DISTURBANCE, NOISE_PART = "disturbance, drawn and limited", "sensor noise, drawn"
_SET_UP = "draw, set-up and row"


@dataclass(frozen=True)
class CampaignParts:
    """Means over some runs: ms of a run as a campaign does it, of its parts, and its periods."""

    runs: int
    whole_ms: float
    parts_ms: dict[str, float]
    periods: float
    """Control periods of the three charges together."""


class _Times:
    def __init__(self, clock_ns: ClockNs) -> None:
        self._clock_ns = clock_ns
        self.ns = Counter[str]()

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        begin_ns = self._clock_ns()
        yield
        self.ns[part] += self._clock_ns() - begin_ns


def campaign_parts(
    preset: str, runs: int, clock_ns: ClockNs, told: Callable[[Row, Row], None] = lambda a, b: None
) -> CampaignParts:
    """Time the first runs of a campaign as a whole and part by part; `told` gets both rows."""
    settings = CampaignSettings(*load_pair(preset, None), runs=runs)
    scenario = Scenario(settings)
    run_one(scenario, settings, 0)
    whole, parts, periods = _Times(clock_ns), _Times(clock_ns), 0
    for run in range(runs):
        with whole.of("run"):
            expected = run_one(scenario, settings, run)
        found, ran = _timed_run(scenario, settings, run, parts)
        periods += ran
        told(expected, found)
    scale = _MS_PER_NS / runs
    means = {name: time_ns * scale for name, time_ns in parts.ns.items()}
    return CampaignParts(runs, whole.ns["run"] * scale, means, periods / runs)


def _timed_run(
    scenario: Scenario, settings: CampaignSettings, run: int, times: _Times
) -> tuple[Row, int]:
    """The work of hil_sim.studies.campaign.worker in the order of its parts."""
    preset = settings.preset
    step_s = preset.timing.sampling_period_s / SUB_STEPS
    with times.of(_SET_UP):
        numbers = streams(settings.seed, run)
        drawn = draw(preset, run, numbers.draw)
        true_cell = drawn.true_cell(preset)
    with times.of(_DISTURBANCE):
        slope_K_per_s2 = drawn.disturbance_share * preset.uncertainty.surface_rate_K_per_s2
        bounds, longest_s = knot_bounds(preset), settings.max_time_s + 60.0
        share, rng = drawn.disturbance_share, numbers.disturbance
        blocks = knot_blocks(drawn.disturbance, bounds, share, step_s, longest_s, rng)
        first = blocks(1)
        limit_slope(first, 0.0, slope_K_per_s2 * step_s)

    def charge(name: str, is_watched: bool) -> CampaignCharge:
        return CampaignCharge(scenario, name, true_cell, first[0], is_watched)

    with times.of(_SET_UP):
        charges = {name: charge(name, name == FIRMWARE) for name in CONTROLLERS}
    unwatched = charge(FIRMWARE, False)
    pieces: list[tuple[Array, Array]] = []
    before = float(first[0, 2])
    while not all(one.is_over for one in charges.values()):
        with times.of(NOISE_PART):
            normals = numbers.sensors.standard_normal((BLOCK_PERIODS, 5))
        with times.of(_DISTURBANCE):
            knots = blocks(BLOCK_PERIODS * SUB_STEPS)
            limit_slope(knots, before, slope_K_per_s2 * step_s)
        before = float(knots[-1, 2])
        pieces.append((normals, knots))
        for name, one in charges.items():
            with times.of(name):
                one.advance(normals, knots)
    with times.of("unwatched"):
        for normals, knots in pieces:
            unwatched.advance(normals, knots)
    all_knots = np.concatenate([knots for _, knots in pieces])
    for name, one in charges.items():
        count = (int(one.fields.periods) - 1) * SUB_STEPS
        _hold(true_cell, step_s, first[0], all_knots[:count], times, f"cell of {name}")
    _attribute(times)
    with times.of(_SET_UP):
        found = row(preset, run, drawn, charges)
    return found, sum(int(one.fields.periods) for one in charges.values())


def _hold(
    true_cell: TrueCell, step_s: float, first: Array, knots: Array, times: _Times, name: str
) -> None:
    """As many sub-steps of the cell alone as a charge has, by one call."""
    cell = ffi.new("cell_t *", cell_fields(true_cell.cell, step_s))
    memory = ffi.new("cell_memory_t *", {"state": tuple(true_cell.state)})
    knot = ffi.new("cell_state_t *", tuple(map(float, first)))
    peaks = ffi.new("cell_peaks_t *")
    content = ffi.from_buffer("double[]", np.ascontiguousarray(knots))
    power_W, none = true_cell.cooling_power_W, ffi.NULL
    with times.of(name):
        lib.cell_hold(cell, memory, 0.0, power_W, 1.0, knot, content, len(knots), peaks, none, none)


def _attribute(times: _Times) -> None:
    """Give the time of each charge to the cell in it and to what is around that."""
    ns = times.ns
    cells = {name: ns.pop(f"cell of {name}") for name in CONTROLLERS}
    unwatched, watched = ns.pop("unwatched"), ns.pop(FIRMWARE)
    ns[CELL_PART] += sum(cells.values())
    ns[WATCH_PART] += watched - unwatched
    ns[FIRMWARE_PART] += unwatched - cells.pop(FIRMWARE)
    for name, cell_ns in cells.items():
        ns[_BASELINES] += ns.pop(name) - cell_ns
