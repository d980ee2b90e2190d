"""The fault matrix as data: rows of fault, expected reaction and deadline, read and expanded."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from annotated_types import Ge, Gt, Le, Len

from bms.errors import InputError
from bms.validation import Positive, parse, read_toml, strict
from hil_sim.bus.catalog import FirstFault, RequiredName
from hil_sim.bus.database import MessageCodec, load_codecs
from hil_sim.fault_matrix.needs import Need
from hil_sim.fault_matrix.size import Size
from hil_sim.faults.base import Fault
from hil_sim.faults.frames import MessageName
from hil_sim.faults.plan import check, parse_fault
from hil_sim.faults.sensors import SensorName

EACH = "each"
_EACH_OF = {
    "message": get_args(RequiredName),
    "sensor": get_args(SensorName),
}

Reaction = Literal["stops", "resumes", "restrains", "rides-through"]
State = Literal["standby", "complete", "fault"]
Periods = Annotated[int, Ge(1)]


@strict
@dataclass(frozen=True, kw_only=True)
class Start:
    """Where the charge of a row begins; without a figure that of the preset stands.

    A temperature may be given by how far it is below the preset's lower limit, and the fault's
    first period by the share of the preset's strongest current to which the current has grown.
    What that is for a preset says hil_sim.fault_matrix.place.
    """

    soc: Annotated[float, Ge(0.0), Le(1.0)] | None = None
    temperature_K: Positive | None = None
    below_limit_K: Positive | None = None
    onset_period: Annotated[int, Ge(0)] | None = None
    onset_current_share: Annotated[float, Gt(0.0), Le(1.0)] | None = None
    after_periods: Periods

    def __post_init__(self) -> None:
        if self.temperature_K is not None and self.below_limit_K is not None:
            raise InputError("temperature_K, below_limit_K: give one of them or neither")
        if (self.onset_period is None) == (self.onset_current_share is None):
            raise InputError("onset_period, onset_current_share: give one of them")


@strict
@dataclass(frozen=True, kw_only=True)
class Expectation:
    """What the ECU has to do. Deadlines count periods from the fault's first one, which is 1.

    stops: from the deadline on 0 A is commanded and flows, for good, and the ECU is in `state`.
    resumes: 0 A by the deadline, and current again resumes_periods after the fault's end; without
    a deadline there may be a pause, but need not.
    restrains: from the deadline on less current flows than before the fault, perhaps 0 A.
    rides-through: current flows all the time.
    `latches` is a fault that has latched by latch_deadline_periods; without it, none may.
    """

    reaction: Reaction
    deadline_periods: Periods | None = None
    latches: str | None = None
    latch_deadline_periods: Periods | None = None
    resumes_periods: Periods | None = None
    state: State = "fault"

    def __post_init__(self) -> None:
        wanted = {
            "deadline_periods": {"stops": True, "restrains": True, "rides-through": False},
            "resumes_periods": dict.fromkeys(("stops", "restrains", "rides-through"), False)
            | {"resumes": True},
            "latches": dict.fromkeys(("resumes", "restrains", "rides-through"), False),
        }
        for key, by_reaction in wanted.items():
            is_wanted = by_reaction.get(self.reaction)
            if is_wanted is not None and (getattr(self, key) is not None) != is_wanted:
                do = "give it" if is_wanted else "leave it out"
                raise InputError(f"{key}: reaction '{self.reaction}': {do}")
        if (self.latches is None) != (self.latch_deadline_periods is None):
            raise InputError("latches, latch_deadline_periods: give both or neither")


@strict
@dataclass(frozen=True, kw_only=True)
class _Row:
    name: str
    fault: dict[str, Any]
    expect: Expectation
    start: str = "warm"
    realtime: bool = False
    needs: tuple[Need, ...] = ()
    size: Size | None = None
    note: str = ""


@strict
@dataclass(frozen=True, kw_only=True)
class _Matrix:
    start: dict[str, Start]
    row: Annotated[tuple[_Row, ...], Len(1)]
    fault_of_message: dict[MessageName, str] = field(default_factory=dict)
    range_of_sensor: dict[SensorName, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Row:
    """One run of the matrix: its fault, where it starts, and what the ECU has to do."""

    name: str
    fault: Fault
    expect: Expectation
    start: Start
    realtime: bool
    note: str
    needs: tuple[Need, ...] = ()
    size: Size | None = None
    """What of a preset the fault's figures are multiplied with; None for figures as they stand."""

    @property
    def latches(self) -> int | None:
        """Number of the fault that has to latch."""
        return None if self.expect.latches is None else fault_numbers()[self.expect.latches]


def fault_numbers() -> dict[str, int]:
    """Numbers of the firmware's faults by name, such as surface-deficit."""
    faults = (fault for fault in FirstFault if fault is not FirstFault.NONE)
    return {fault.label.replace("_", "-"): fault.value for fault in faults}


def matrix_path() -> Path:
    """The matrix that comes with the package."""
    return Path(str(files("hil_sim") / "fault_matrix" / "matrix.toml"))


def load_matrix(path: Path | None = None) -> tuple[Row, ...]:
    """Every row, with rows for several messages, bytes or values expanded into one each.

    Raises InputError in one line with file, row, key and remedy.
    """
    path = path or matrix_path()
    matrix = parse(_Matrix, read_toml(path), str(path))
    database = load_codecs()
    rows = tuple(row for text in matrix.row for row in _expanded(text, matrix, database, str(path)))
    names = [row.name for row in rows]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: row '{name}': there are two; give each a name of its own")
    return rows


def _expanded(
    text: _Row, matrix: _Matrix, database: Mapping[str, MessageCodec], path: str
) -> Iterator[Row]:
    where = f"{path}: row '{text.name}'"
    if text.start not in matrix.start:
        raise InputError(
            f"{where}: start: no '{text.start}'; give one of {', '.join(matrix.start)}"
        )
    start = matrix.start[text.start]
    for content, label in _variants(text.fault, database):
        fault = parse_fault({**content, "from_period": start.onset_period or 0}, f"{where}: fault")
        check(fault, database, where)
        yield Row(
            name=f"{text.name}: {label}" if label else text.name,
            fault=fault,
            expect=_expectation(text.expect, matrix, content, where),
            start=start,
            realtime=text.realtime,
            note=text.note,
            needs=text.needs,
            size=text.size,
        )


def _variants(
    fault: Mapping[str, Any], database: Mapping[str, MessageCodec]
) -> Iterator[tuple[dict[str, Any], str]]:
    """The fault with one of each of its lists at a time, and what tells it from the others."""
    lists = {
        key: _EACH_OF[key] if value == EACH else value
        for key, value in fault.items()
        if isinstance(value, list) or (value == EACH and key in _EACH_OF)
    }
    for values in itertools.product(*lists.values()):
        content = {**fault, **dict(zip(lists, values))}
        label = ", ".join(_label(key, value) for key, value in zip(lists, values))
        if content.get("byte") == EACH:
            for byte in range(database[content["message"]].length):
                yield {**content, "byte": byte}, f"{label} {_label('byte', byte)}".strip()
        else:
            yield content, label


def _label(key: str, value: Any) -> str:
    if key == "frame_id":
        return f"id {value:#x}"
    return str(value) if isinstance(value, str) else f"{key} {value}"


def _expectation(
    expect: Expectation, matrix: _Matrix, content: Mapping[str, Any], where: str
) -> Expectation:
    """The expectation with the one fault that this variant latches."""
    latches = expect.latches
    if latches == "fault_of_message":
        latches = _look_up(matrix.fault_of_message, content.get("message"), where)
    elif latches == "range_of_sensor":
        latches = _look_up(matrix.range_of_sensor, content.get("sensor"), where)
    if latches is not None and latches not in fault_numbers():
        raise InputError(
            f"{where}: expect.latches: no fault '{latches}' in monitor.h; "
            f"give one of {', '.join(fault_numbers())}"
        )
    return replace(expect, latches=latches)


def _look_up(faults: Mapping[Any, str], key: object, where: str) -> str:
    if key not in faults:
        raise InputError(f"{where}: expect.latches: nothing for {key}; add it to the table")
    return faults[key]
