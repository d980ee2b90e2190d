"""What the project wants to reach, beside what was measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from hil_sim.studies.bench.board import BoardCost
from hil_sim.studies.bench.race import Absent, Timed
from hil_sim.studies.bench.run import Result


@dataclass(frozen=True)
class Aim:
    """One of them; "times" is a ratio, and what its unit counts is to be large or small."""

    name: str
    measured: float
    wanted: float
    unit: Literal["ns", "instructions", "B", "times", "runs/s"]

    @property
    def is_small_wanted(self) -> bool:
        """Whether less is better: time, work, memory."""
        return self.unit in ("ns", "instructions", "B")

    @property
    def is_reached(self) -> bool:
        """Whether it is as small, or as large, as wanted."""
        if self.is_small_wanted:
            return self.measured <= self.wanted
        return self.measured >= self.wanted


_SLOWER = (
    ("estimate", "KAN in pykan, one at a time", 1000.0),
    ("decision", "OSQP, warm update and solve", 100.0),
    ("decision", "OSQP, set-up and solve", 100.0),
    ("decision", "SciPy SLSQP", 5000.0),
)
_FASTEST_ns = 100.0
_PERIOD_ns = 250.0
_BUS_AIMS = {("virtual", 1): 1000.0, ("socketcan", 1): 25.0, ("socketcan", 2): 15.0}
"""By interface, and the number of processes of plant and ECU."""
_CAMPAIGN_RUNS_PER_S = 130.0
"""Of each core."""
HARD_FLOAT = "mps2-an386"
"""The board that instructions are asked of."""
_INSTRUCTIONS = 1000.0
PERIOD_INSTRUCTIONS = 4000.0
_KIB = 1024.0
_APPLICATION_B = {HARD_FLOAT: 16.0 * _KIB, "mps2-an385": 18.0 * _KIB}
_IMAGE_B = 32.0 * _KIB


def aims(result: Result) -> Iterator[Aim]:
    """The aims of the sections that were run."""
    if result.estimate and result.decision:
        both_ns = _in_c(result.estimate).time_ns.median + _in_c(result.decision).time_ns.median
        yield Aim("estimate plus decision in C", both_ns, _FASTEST_ns, "ns")
    for section, name, wanted in _SLOWER:
        rows: list[Timed | Absent] = getattr(result, section)
        for row in rows:
            if isinstance(row, Timed) and row.name == name:
                ratio = row.time_ns.median / _in_c(rows).time_ns.median
                yield Aim(f"{name}, over C", ratio, wanted, "times")
    for row in result.period:
        if isinstance(row, Timed):
            yield Aim("control period with frames in C", row.time_ns.median, _PERIOD_ns, "ns")
    for speed in result.simulation:
        key = speed.bus.partition(":")[0], speed.processes
        if speed.times_real_time is not None and key in _BUS_AIMS:
            name = f"simulation on {speed.bus}, {speed.parties}"
            yield Aim(name, speed.times_real_time.median, _BUS_AIMS[key], "times")
    if result.campaign:
        largest = max(result.campaign, key=lambda campaign: campaign.runs)
        per_core = largest.runs_per_s / largest.jobs
        yield Aim("campaign, runs a second and core", per_core, _CAMPAIGN_RUNS_PER_S, "runs/s")
    yield from _of_boards(result.board)


def _of_boards(costs: list[BoardCost]) -> Iterator[Aim]:
    for cost in costs:
        counts = (
            ("estimate and decision, worst of a charge", cost.estimate_and_decision_worst),
            ("control period with frames, median", cost.period_median),
        )
        for (name, measured), wanted in zip(counts, (_INSTRUCTIONS, PERIOD_INSTRUCTIONS)):
            if measured is not None and cost.board == HARD_FLOAT:
                yield Aim(f"{name} on {cost.board}", measured, wanted, "instructions")
        if cost.application_flash_B is not None:
            wanted = _APPLICATION_B[cost.board]
            yield Aim(
                f"flash of the application on {cost.board}", cost.application_flash_B, wanted, "B"
            )
        if cost.image_flash_B is not None:
            yield Aim(f"flash of the image on {cost.board}", cost.image_flash_B, _IMAGE_B, "B")


def _in_c(rows: list[Timed | Absent]) -> Timed:
    first = rows[0]
    assert isinstance(first, Timed)
    return first
