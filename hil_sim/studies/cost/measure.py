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
) -> CostReport:
    """Count over a whole charge, `charges` random beginnings of charges, and `states` states in
    each generation of the search. The program holds the default preset's tables.

    `note` is told which of the PARTS comes next. Raises InputError.
    """
    rng = np.random.default_rng(seed)
    note(f"charge on {board}")
    records, charging = charge_records(Settings(preset, seed=seed))
    whole = count(program, board, records)
    note(f"beginnings of charges on {board}")
    random = count(program, board, list(random_charges(preset, charges, rng)))

    def count_states(records: Sequence[bytes]) -> Counts:
        note(f"search on {board}")
        return count(program, board, records)

    searched = search_states(preset, states, rng, count_states)
    both = whole.estimate + whole.decision
    series = {
        "estimate": whole.estimate,
        "decision": whole.decision,
        "estimate_and_decision": both,
        "control_period": whole.period,
    }
    found = {
        "estimate": (random.estimate, searched.estimate),
        "decision": (random.decision, searched.decision),
        "estimate_and_decision": (
            random.estimate + random.decision,
            searched.estimate + searched.decision,
        ),
        "control_period": (random.period,),
    }
    costs = {kind: _cost(series[kind][charging], found[kind]) for kind in series}
    return CostReport(board, costs, series, charging)


def _cost(charge: Instructions, found: tuple[Instructions, ...]) -> Cost:
    return Cost(
        charge_minimum=int(charge.min()),
        charge_median=int(np.median(charge)),
        charge_worst=int(charge.max()),
        search_worst=max(int(values.max(initial=0)) for values in found),
    )
