"""Whether a run of the matrix went as its row expects."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from bms.presets import Preset
from hil_sim.fault_matrix.matrix import Reaction, Row, fault_numbers
from hil_sim.fault_matrix.needs import unmet
from hil_sim.run.result import RunResult


@dataclass(frozen=True)
class Verdict:
    """A row with what was seen. Periods count from the fault's first one, which is 1."""

    row: Row
    first_zero_period: int | None
    """First period with 0 A, commanded or for want of a command, and flowing."""
    latched_period: int | None
    latched: tuple[str, ...]
    final_state: str | None
    final_current_A: float
    max_core_temperature_K: float
    max_surface_temperature_K: float
    max_voltage_V: float
    wall_time_s: float
    failures: tuple[str, ...]
    does_not_apply: str | None = None
    """Why reaction and latch say nothing with this preset."""

    @property
    def passed(self) -> bool:
        """Whether the run went as its row expects and no limit of the plant was crossed."""
        return not self.failures


class _Seen:
    """The periods of a run from its fault on, number 1 first."""

    def __init__(self, row: Row, result: RunResult) -> None:
        series = result.series
        window = row.fault.window(series.period_s)
        begin = series.charge_period.index(window.start)
        self.end = len(window) if not row.fault.is_for_good else len(series.time_s) - begin
        self.flowing_A = series.current_A[begin:]
        self.command_A = series.usable_command_A[begin:]
        self.state = series.state[begin:]
        self.latched = series.latched_faults[begin:]
        self.before_A = series.current_A[begin - 1] if begin else 0.0
        self.zero = [
            command_A in (None, 0.0) and flowing_A == 0.0
            for command_A, flowing_A in zip(self.command_A, self.flowing_A)
        ]


def judge(row: Row, preset: Preset, result: RunResult) -> Verdict:
    """Compare a run with what its row, which follows the preset, expects."""
    seen, summary = _Seen(row, result), result.summary
    reaction = [*_REACTIONS[row.expect.reaction](row, seen), *_latch_failures(row, seen)]
    reason = None
    if reaction and seen.before_A < 0.0:
        onset = row.fault.window(result.series.period_s).start
        reason = unmet(row.needs, preset, result, onset)
    failures = [
        *([] if seen.before_A < 0.0 else ["no current flowed before the fault"]),
        *([] if reason else reaction),
        *(f"plant: {violation}" for violation in summary.violations),
    ]
    latched = functools.reduce(operator.or_, (bits or 0 for bits in seen.latched))
    return Verdict(
        row=row,
        first_zero_period=_number(seen.zero),
        latched_period=_number([bool(bits) for bits in seen.latched]),
        latched=tuple(name for name, n in fault_numbers().items() if latched >> n & 1),
        final_state=_last(seen.state),
        final_current_A=seen.flowing_A[-1],
        max_core_temperature_K=summary.max_core_temperature_K,
        max_surface_temperature_K=summary.max_surface_temperature_K,
        max_voltage_V=summary.max_voltage_V,
        wall_time_s=summary.wall_time_s,
        failures=tuple(failures),
        does_not_apply=reason,
    )


def _stops(row: Row, seen: _Seen) -> Iterator[str]:
    deadline = row.expect.deadline_periods or 1
    late = _number([not zero for zero in seen.zero], deadline)
    if late is not None:
        yield f"{_current(seen, late)} in period {late}"
    state = _last(seen.state)
    # Without a charge command nothing is heard of the state.
    if state not in (None, row.expect.state):
        yield f"state {state} at the end, not {row.expect.state}"


def _resumes(row: Row, seen: _Seen) -> Iterator[str]:
    deadline, resumes = row.expect.deadline_periods, row.expect.resumes_periods or 1
    if deadline is not None and not any(seen.zero[:deadline]):
        yield f"never 0 A up to period {deadline}"
    gap = _number([not current_A < 0.0 for current_A in seen.flowing_A], seen.end + resumes)
    if gap is not None:
        yield f"no current again in period {gap}"


def _restrains(row: Row, seen: _Seen) -> Iterator[str]:
    is_more = [current_A <= seen.before_A for current_A in seen.flowing_A]
    late = _number(is_more, row.expect.deadline_periods or 1)
    if late is not None:
        yield f"{_current(seen, late)} in period {late}, no less than before"


def _rides_through(row: Row, seen: _Seen) -> Iterator[str]:
    gap = _number([not current_A < 0.0 for current_A in seen.flowing_A])
    if gap is not None:
        yield f"no current in period {gap}"


_REACTIONS: dict[Reaction, Callable[[Row, _Seen], Iterator[str]]] = {
    "stops": _stops,
    "resumes": _resumes,
    "restrains": _restrains,
    "rides-through": _rides_through,
}


def _latch_failures(row: Row, seen: _Seen) -> Iterator[str]:
    if row.latches is None:
        number = _number([bool(bits) for bits in seen.latched])
        if number is not None:
            yield f"a fault latched in period {number}"
        return
    bit, deadline = 1 << row.latches, row.expect.latch_deadline_periods or 1
    number = _number([bool((bits or 0) & bit) for bits in seen.latched])
    if number is None:
        yield f"{row.expect.latches} never latched"
    elif number > deadline:
        yield f"{row.expect.latches} latched in period {number}, not by {deadline}"


def _current(seen: _Seen, number: int) -> str:
    command_A, flowing_A = seen.command_A[number - 1], seen.flowing_A[number - 1]
    commanded = "no command" if command_A is None else f"{command_A:g} A commanded"
    return f"{commanded}, {flowing_A:g} A flowing"


def _number(conditions: Sequence[bool], first: int = 1) -> int | None:
    """Number of the first period in which a condition holds, looked for from `first` on."""
    periods = range(first, len(conditions) + 1)
    return next((number for number in periods if conditions[number - 1]), None)


def _last(states: Sequence[str | None]) -> str | None:
    return next((state for state in reversed(states) if state is not None), None)
