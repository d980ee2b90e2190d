"""Plays rows of the matrix in closed loop, several at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace

from bms.model.model_file import KanModel
from bms.presets import Preset
from hil_sim.bus.catalog import Mode
from hil_sim.fault_matrix.matrix import Row, Start
from hil_sim.fault_matrix.place import Place, find_place, nominal_onset
from hil_sim.fault_matrix.size import sized
from hil_sim.fault_matrix.verdict import Verdict, judge
from hil_sim.run.session import run_both, run_on_clocks
from hil_sim.run.settings import Settings
from hil_sim.run.workforce import local_workforce

VIRTUAL = "virtual:"
_ANSWER_TIMEOUT_S = {True: 0.0, False: 0.05}
"""By whether the bus is virtual; there an answer has come before the plant looks for it."""


@dataclass(frozen=True)
class MatrixSettings:
    """What determines the runs of all rows but the rows themselves."""

    preset: Preset
    model: KanModel
    bus: str = "virtual:faults"
    seed: int = 0

    @property
    def is_virtual(self) -> bool:
        """Whether each process has a bus of its own."""
        return self.bus.startswith(VIRTUAL)


def play(settings: MatrixSettings, row: Row) -> Verdict:
    """Run one row and judge it. Raises InputError or BusError."""
    run = run_on_clocks if row.realtime else run_both
    place = place_of(settings, row.start)
    result = run(run_settings(settings, row, place))
    return judge(_followed(row, settings.preset, place), settings.preset, result)


def place_of(settings: MatrixSettings, start: Start) -> Place:
    """Where rows with a start begin for these settings; found once in a process."""
    key = (settings.preset.hash, settings.model.hash, settings.seed, start)
    if key not in _PLACES:
        _PLACES[key] = find_place(settings.preset, settings.model, start, settings.seed)
    return _PLACES[key]


_PLACES: dict[tuple[str, str, int, Start], Place] = {}


def _followed(row: Row, preset: Preset, place: Place) -> Row:
    """The row with its fault in the period and of the size that fit the preset."""
    fault = replace(row.fault, from_period=place.onset)
    return replace(row, fault=sized(fault, row.size, preset))


def run_settings(settings: MatrixSettings, row: Row, place: Place) -> Settings:
    """The run of a row: a charge with one fault, until some time after it."""
    periods = place.onset + row.start.after_periods
    return Settings(
        preset=settings.preset,
        initial=place.initial,
        model=settings.model,
        # Rows need a current that is limited by what they disturb, which a plan rarely is.
        mode=Mode.FIXED,
        bus=settings.bus,
        seed=settings.seed,
        max_time_s=periods * settings.preset.timing.sampling_period_s,
        realtime=row.realtime,
        answer_timeout_s=_ANSWER_TIMEOUT_S[settings.is_virtual],
        faults=(_followed(row, settings.preset, place).fault,),
        ends_early=False,
    )


def play_all(
    settings: MatrixSettings,
    rows: Sequence[Row],
    jobs: int,
    progress: Callable[[], None] = lambda: None,
) -> list[Verdict]:
    """Verdicts in the order of the rows. On a real bus, which all rows share, one at a time.

    Raises InputError or BusError.
    """
    with local_workforce(jobs if settings.is_virtual else 1) as workforce:
        # The long ones first, so that none is left over at the end.
        order = sorted(rows, key=lambda row: (not row.realtime, -_periods(settings, row)))
        futures = {row.name: workforce.executor.submit(play, settings, row) for row in order}
        for future in as_completed(futures.values()):
            future.result()
            progress()
    return [futures[row.name].result() for row in rows]


def _periods(settings: MatrixSettings, row: Row) -> int:
    return nominal_onset(settings.preset, row.start) + row.start.after_periods
