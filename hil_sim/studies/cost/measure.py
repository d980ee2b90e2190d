"""Cost of the firmware's work on a board: over a charge, and the worst that a search finds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bms.arrays import IntArray, Mask
from bms.presets import Preset
from hil_sim.run.settings import Settings
from hil_sim.studies.cost.charges import charge_records, random_charges
from hil_sim.studies.cost.counting import count
from hil_sim.studies.cost.records import Counts
from hil_sim.studies.cost.search import GENERATIONS, search_states

Instructions = IntArray

PARTS = 2 + GENERATIONS
"""Of the work on a board: a charge, beginnings of charges, the search."""


@dataclass(frozen=True)
class Cost:
    """Instructions of one kind of work."""

    charge_minimum: int
    charge_median: int
    charge_worst: int
    search_worst: int

    @property
    def worst(self) -> int:
        """The largest that was seen anywhere."""
        return max(self.charge_worst, self.search_worst)


@dataclass(frozen=True)
class CostReport:
    """Costs by kind of work on one board, and each kind's instructions in every period (N,)."""

    board: str
    costs: dict[str, Cost]
    series: dict[str, Instructions]
    charging: Mask
    """(N,) the periods with a decision, which the figures of a charge are taken from."""

    def to_json(self) -> dict[str, Any]:
        """Board, unit, and by kind of work its costs in instructions."""
        return {
            "board": self.board,
            "unit": "instructions",
            **{kind: {**vars(cost), "worst": cost.worst} for kind, cost in self.costs.items()},
        }


def measure_cost(
    program: Path,
    board: str,
    preset: Preset,
    seed: int,
    charges: int,
    states: int,
    note: Callable[[str], None] = lambda part: None,
    calibration: bytes | None = None,
) -> CostReport:
    """Count over a whole charge, `charges` random beginnings of charges, and `states` states in
    each generation of the search. `calibration` is the preset's block where the program was built
    with another's.

    A family's states are searched by beginnings of charges alone, since they hold what came before.
    `note` is told which of the PARTS comes next. Raises InputError.
    """
    rng = np.random.default_rng(seed)

    def counted(records: Sequence[bytes], part: str) -> Counts:
        note(f"{part} on {board}")
        return count(program, board, records, calibration=calibration)

    records, charging = charge_records(Settings(preset, seed=seed))
    whole = counted(records, "charge")
    searched = [counted(list(random_charges(preset, charges, rng)), "beginnings of charges")]
    if preset.cell.interval is None:
        searched.append(
            search_states(preset, states, rng, lambda records: counted(records, "search"))
        )
    kinds: dict[str, Callable[[Counts], Instructions]] = {
        "estimate": lambda counts: counts.estimate,
        "observation": lambda counts: counts.observation,
        "decision": lambda counts: counts.decision,
        "estimate_and_decision": lambda counts: counts.together,
        "control_period": lambda counts: counts.period,
    }
    series = {kind: of(whole) for kind, of in kinds.items()}
    found = {kind: tuple(map(of, searched)) for kind, of in kinds.items()}
    costs = {kind: _cost(series[kind][charging], found[kind]) for kind in series}
    return CostReport(board, costs, series, charging)


def _cost(charge: Instructions, found: tuple[Instructions, ...]) -> Cost:
    return Cost(
        charge_minimum=int(charge.min()),
        charge_median=int(np.median(charge)),
        charge_worst=int(charge.max()),
        search_worst=max(int(values.max(initial=0)) for values in found),
    )
