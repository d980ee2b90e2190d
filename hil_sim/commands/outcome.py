"""What the charging commands have in common: settings, run, show, write, exit code."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console

from bms.cli import EXIT_CHECK_FAILED, EXIT_DONE
from bms.presets import Preset
from bms.waiting import waiting
from hil_sim.commands.recordings import outputs
from hil_sim.faults import load_faults
from hil_sim.logs.recorder import Recorder
from hil_sim.plant.disturbances import DisturbanceKind
from hil_sim.report.files import summary_json, write_report
from hil_sim.report.table import print_table
from hil_sim.run.result import RunResult
from hil_sim.run.settings import Settings


class Run(Protocol):
    """A way to run a charge."""

    def __call__(
        self, settings: Settings, recorder: Recorder | None = None, progress: Any = ...
    ) -> RunResult:
        """Run a charge to its end; `progress` is told the state of charge of each period."""
        ...


def charge_settings(
    preset: Preset,
    bus: str,
    seed: int,
    disturbance: DisturbanceKind,
    faults: Path | None,
    max_time_s: float,
    realtime: bool,
    plant: str,
) -> Settings:
    """What the options that all charging commands have say of a run.

    Raises InputError for a file of faults that cannot be used.
    """
    return Settings(
        preset=preset,
        bus=bus,
        seed=seed,
        disturbance=disturbance,
        faults=() if faults is None else load_faults(faults),
        max_time_s=max_time_s,
        realtime=realtime,
        plant=plant,
    )


def charge_and_report(
    settings: Settings,
    run: Run,
    out: Path | None,
    as_json: bool,
    baselines: Sequence[Settings] = (),
    log: Path | None = None,
) -> int:
    """Run a charge, and baselines beside it; print and write what came of it.

    `log` is one more recording of the controller's bus, in the format of its suffix. Returns the
    exit code: 1 when the controller, not a baseline, failed its check, or when its time ended
    before the charge did. Raises InputError before the run when the folder or the log cannot be
    written.
    """
    with outputs(out, log) as kept:
        with kept.recorder() as recorder:
            results = [_followed(settings, run, recorder)]
        results += [_followed(baseline, run, None) for baseline in baselines]
        if kept.folder is not None:
            write_report(kept.folder, settings, results)
        kept.commit()
    if as_json:
        print(json.dumps(summary_json(results), indent=2))
    else:
        print_table(Console(), settings, results, out)
    summary = results[0].summary
    if summary.shortfall is not None:
        print(f"bms: {summary.name}: {summary.shortfall}; see --max-time-s", file=sys.stderr)
    return EXIT_DONE if summary.passed and summary.shortfall is None else EXIT_CHECK_FAILED


def _followed(settings: Settings, run: Run, recorder: Recorder | None) -> RunResult:
    """Run, and tell the state of charge meanwhile."""
    doing = f"{settings.name}, state of charge"
    with waiting(doing, completed=settings.preset.initial.soc) as wait:
        return run(settings, recorder, wait.reach)
