"""The charges of a reproduction, run side by side in several processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass

from bms.errors import BmsError
from bms.firmware import Ecu
from bms.presets import load_preset
from bms.presets.paper_form import in_paper_form
from hil_sim.bus.catalog import Mode
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.run.result import RunResult
from hil_sim.run.session import run_both
from hil_sim.run.settings import ControllerKind, Settings
from hil_sim.run.workforce import WorkerPool
from hil_sim.studies.reproduction.margins import MARGINS, Margin

PRESETS = ("paper_calibrated", "lin2014")
DISTURBANCES = (DisturbanceKind.NONE, DisturbanceKind.GAUSSIAN, DisturbanceKind.UPWARD)
"""None, the paper's own, and the worst within the bounds."""


@dataclass(frozen=True)
class Case:
    """One charge: with a margin only for the firmware without that margin."""

    preset: str
    controller: ControllerKind = ControllerKind.KAN_RCBF
    disturbance: DisturbanceKind = DisturbanceKind.NONE
    without: Margin | None = None


Results = dict[Case, RunResult]


def all_cases(presets: Sequence[str] = PRESETS) -> list[Case]:
    """Every controller under every disturbance, and the firmware without each margin."""
    return [
        case
        for preset in presets
        for case in (
            *(Case(preset, kind, noise) for kind in ControllerKind for noise in DISTURBANCES),
            *(Case(preset, without=margin) for margin in MARGINS),
        )
    ]


def run_case(case: Case, seed: int, max_time_s: float) -> RunResult:
    """Charge as a case says, with the seed of all others."""
    settings = Settings(
        in_paper_form(load_preset(case.preset)),
        controller=case.controller,
        mode=Mode.FIXED,
        disturbance=case.disturbance,
        seed=seed,
        max_time_s=max_time_s,
    )
    if (margin := case.without) is None:
        return run_both(settings)
    return run_both(
        settings,
        ecu_factory=lambda plant, database: Ecu(settings.preset, changes=margin.changes),
    )


def run_cases(
    cases: Sequence[Case],
    seed: int,
    jobs: int,
    max_time_s: float,
    on_done: Callable[[], None] = lambda: None,
) -> Results:
    """Results of all cases, in their order whatever the number of processes.

    Raises BmsError when the system ends one of the processes.
    """
    pool = WorkerPool(jobs)
    try:
        futures = [pool.submit(run_case, case, seed, max_time_s) for case in cases]
        for future in as_completed(futures):
            future.result()
            on_done()
    except BrokenProcessPool:
        raise BmsError(
            "a charge was ended by the system, perhaps for lack of memory; lower --jobs"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)
    return {case: future.result() for case, future in zip(cases, futures)}
