"""Faults of a pack as rows of the fault matrix: played, judged, and reported as those of a cell."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass

import numpy as np

from bms.errors import InputError
from bms.validation import strict
from hil_sim.bus.catalog import CommandState, FirstFault
from hil_sim.fault_matrix.matrix import Expectation, Row, Start
from hil_sim.fault_matrix.verdict import Verdict
from hil_sim.faults.base import Fault
from hil_sim.pack.charge import PackResult
from hil_sim.pack.faults import (
    BEGIN_PERIOD,
    FAULTS,
    LEAST_CELLS,
    PackFault,
    complaint,
    is_charging,
    run_fault,
)
from hil_sim.pack.settings import PackChargeSettings
from hil_sim.pack.summary import KINDS, margins
from hil_sim.run.workforce import local_workforce

AFTER_PERIODS = 20
"""For which a row goes on after its deadline."""
VIRTUAL = "virtual:"


@strict
@dataclass(frozen=True, kw_only=True)
class _OfPack(Fault):
    """What a row says of its fault."""

    kind: str = "pack"

    @property
    def where(self) -> str:
        return "readings and frames of a pack"


def pack_rows() -> tuple[Row, ...]:
    """Every fault of a pack; deadlines count from the fault's first period, which is 1."""
    return tuple(_row(fault) for fault in FAULTS)


def _row(fault: PackFault) -> Row:
    last = fault.stop_periods + AFTER_PERIODS
    return Row(
        name=fault.name,
        fault=_OfPack(from_period=BEGIN_PERIOD),
        expect=Expectation(
            reaction="stops",
            deadline_periods=fault.stop_periods + 1,
            latches=" or ".join(map(_label, fault.names)),
            latch_deadline_periods=last,
        ),
        start=Start(onset_period=BEGIN_PERIOD, after_periods=last),
        realtime=False,
        note="",
    )


def _label(fault: FirstFault) -> str:
    return fault.label.replace("_", "-")


def require_rows_fit(cells: int) -> None:
    """Raise InputError for a pack that does not have the cells which the rows are about."""
    if cells < LEAST_CELLS:
        raise InputError(
            f"--cells {cells}: the faults are of cells 4 to {LEAST_CELLS}; give at least that many"
        )


def play_row(settings: PackChargeSettings, row: Row) -> Verdict:
    """Charge a pack with a row's fault and judge it. Raises InputError or BusError."""
    (fault,) = (one for one in FAULTS if one.name == row.name)
    result = run_fault(settings, fault, fault.stop_periods + AFTER_PERIODS)
    missed = complaint(result, fault)
    reason = fault.excuse(settings) if missed is not None and is_charging(result) else None
    commands, latched = (each[BEGIN_PERIOD:] for each in (result.commands_A, result.latched))
    peaks = result.peaks.max(axis=0)
    return Verdict(
        row=row,
        first_zero_period=_first(command_A == 0.0 for command_A in commands),
        latched_period=_first(bits != 0 for bits in latched),
        latched=tuple(
            _label(one) for one in FirstFault if one < 32 and result.latched_faults >> one & 1
        ),
        final_state=CommandState(result.state).label,
        final_current_A=result.supplied_A[-1],
        max_core_temperature_K=float(peaks[1]),
        max_surface_temperature_K=float(peaks[2]),
        max_voltage_V=float(peaks[3]),
        wall_time_s=result.wall_time_s,
        failures=(*([] if missed is None or reason else [missed]), *_crossed(result)),
        does_not_apply=reason,
    )


def _first(conditions: Iterable[bool]) -> int | None:
    return next((number for number, is_so in enumerate(conditions, 1) if is_so), None)


def _crossed(result: PackResult) -> list[str]:
    left = margins(result)
    return [
        f"plant: cell {cell + 1}: {KINDS[kind]} over its limit by {-left[cell, kind]:.3g}"
        for cell, kind in np.argwhere(left < 0.0)
    ]


def play_rows(
    settings: PackChargeSettings,
    rows: Sequence[Row],
    jobs: int,
    progress: Callable[[], None] = lambda: None,
) -> list[Verdict]:
    """Verdicts in the order of the rows. On a real bus, which all rows share, one at a time.

    Raises InputError or BusError.
    """
    with local_workforce(jobs if settings.bus.startswith(VIRTUAL) else 1) as workforce:
        order = sorted(rows, key=lambda row: -row.start.after_periods)
        futures = {row.name: workforce.executor.submit(play_row, settings, row) for row in order}
        for future in as_completed(futures.values()):
            future.result()
            progress()
    return [futures[row.name].result() for row in rows]
