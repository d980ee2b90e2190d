"""Runs of the firmware in this process whose frames other targets are held against."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from bms.errors import InputError
from hil_sim.fault_matrix.matrix import Row
from hil_sim.fault_matrix.runner import MatrixSettings, place_of, run_settings
from hil_sim.logs import ALL, Selection
from hil_sim.logs.recorder import Recorder
from hil_sim.replay.recording import Recording, load_recording
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings

FULL_CHARGE = "full charge"


@dataclass(frozen=True)
class Scenario:
    """A closed-loop run in lock step, as it was recorded on the host."""

    name: str
    recording: Recording


def why_not_played(row: Row) -> str | None:
    """Why a row of the fault matrix cannot be held against a recording; None when it can."""
    if row.fault.needs_own_ecu:
        return "happens inside the ECU, not in its frames"
    if row.realtime:
        return "acts on the wall clock, so that no two runs are alike"
    return None


def record_scenarios(
    settings: MatrixSettings, rows: Sequence[Row], played: Callable[[], None] = lambda: None
) -> list[Scenario]:
    """A full charge, then a charge with each row's fault, on a virtual bus.

    `played` is called after each. Raises InputError for a row that cannot be played.
    """
    scenarios = []
    with TemporaryDirectory() as folder:
        path = Path(folder) / "can.log"
        for name, run in _runs(settings, rows):
            with Recorder(path) as recorder:
                run_both(run, recorder)
            scenarios.append(Scenario(name, load_recording(path)))
            played()
    return scenarios


def _runs(settings: MatrixSettings, rows: Sequence[Row]) -> Iterator[tuple[str, Settings]]:
    yield (
        FULL_CHARGE,
        Settings(settings.preset, model=settings.model, bus=settings.bus, seed=settings.seed),
    )
    for row in rows:
        if (reason := why_not_played(row)) is not None:
            raise InputError(f"row '{row.name}': {reason}; leave it out")
        yield row.name, run_settings(settings, row, place_of(settings, row.start))


def load_scenarios(logs: Sequence[Path], selection: Selection = ALL) -> list[Scenario]:
    """Recorded logs as scenarios.

    Raises InputError for a log that cannot be used, as one without SYNC.
    """
    scenarios = [Scenario(log.name, load_recording(log, selection)) for log in logs]
    for scenario in scenarios:
        if not scenario.recording.lock_step:
            raise InputError(
                f"{scenario.recording.path}: recorded on the wall clock, without SYNC, so that the "
                "ECU's own clock decided; give a log of a run in lock step"
            )
    return scenarios
