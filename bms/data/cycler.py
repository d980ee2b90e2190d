"""Recordings as cyclers write them, brought to the project's units, signs and names."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from bms.arrays import Array
from bms.data.cycler_text import TextTable, read_table
from bms.data.recording_plausibility import require_plausible
from bms.errors import InputError
from bms.files import write_text

ROLES = ("time", "row", "current", "voltage", "surface", "ambient", "core")
"""What a column can be; `row` is the number of the sample where time is missing."""
_NEEDED = ("current", "voltage")
ZERO_CELSIUS_K = 273.15

TemperatureUnit = Literal["degC", "K"]

_NAMES: Mapping[str, tuple[str, ...]] = {
    "time": ("time", "test time", "total time", "elapsed time", "time s", "test time s"),
    "row": ("row", "sample", "index", "data point", "rec", "record"),
    "current": ("current", "i", "current a", "amps", "i a"),
    "voltage": ("voltage", "v", "voltage v", "volts", "u", "ecell v", "u v"),
    "surface": (
        "surface temperature",
        "surface temperature k",
        "surface",
        "temperature",
        "cell temperature",
        "aux temperature 1",
        "temp",
        "t1",
    ),
    "ambient": (
        "ambient temperature",
        "ambient",
        "coolant temperature k",
        "coolant temperature",
        "chamber temperature",
    ),
    "core": ("core temperature k", "core temperature", "core"),
}
"""Names by which a header tells its columns, in small letters and without signs."""


@dataclass(frozen=True)
class ColumnMap:
    """Which column is what: a place from 0, or a name of the header, by role of ROLES."""

    columns: Mapping[str, int | str]

    @classmethod
    def parse(cls, text: str) -> ColumnMap:
        """Map of text such as time=0,current=1,voltage=2,surface=4; InputError says what is wrong.

        Current and voltage must be there; without time, `row` or a sample period tells it.
        """
        columns: dict[str, int | str] = {}
        for part in text.split(","):
            role, equals, place = (piece.strip() for piece in part.partition("="))
            if not equals or role not in ROLES or not place or role in columns:
                raise InputError(
                    f"--columns: '{part.strip()}' is not one of {', '.join(ROLES)} with a place "
                    "from 0 or a name, each once; example: time=0,current=1,voltage=2,surface=4"
                )
            columns[role] = int(place) if place.isdigit() else place
        missing = [role for role in _NEEDED if role not in columns]
        if missing:
            raise InputError(f"--columns: {missing[0]} is missing; say which column it is")
        return cls(columns)


@dataclass(frozen=True)
class CyclerFormat:
    """How a cycler writes: columns (the first map that fits a file), unit, sign, period."""

    maps: tuple[ColumnMap, ...] = ()
    temperature_unit: TemperatureUnit = "K"
    charge_is_positive: bool = False
    sample_period_s: float | None = None


@dataclass(frozen=True)
class CyclerRecording:
    """One file in the project's terms, arrays (N,); the current is negative while charging.

    A temperature that was not recorded is None; `time_is_counted` where rows were numbered by a
    sample period instead of a time column.
    """

    path: Path
    time_s: Array
    current_A: Array
    voltage_V: Array
    surface_K: Array | None
    ambient_K: Array | None
    core_K: Array | None
    time_is_counted: bool
    dropped_rows: int

    @property
    def name(self) -> str:
        """The file's name."""
        return self.path.name

    @property
    def charge_out_As(self) -> Array:
        """Charge taken out since the first row, (N,); a row's current ends at the row.

        Cyclers write the current as it flowed up to the reading, with a switch between two rows.
        """
        steps_As = self.current_A[1:] * np.diff(self.time_s)
        return np.concatenate([[0.0], np.cumsum(steps_As)])


def read_cycler(path: Path, form: CyclerFormat) -> CyclerRecording:
    """A cycler's CSV or TXT file; InputError in one line with file, line or column, and remedy."""
    table = read_table(path)
    columns = _columns(table, form)
    values = {role: _column(table, role, place) for role, place in columns.items()}
    time_s, counted = _time_s(table, values, form)
    keep = np.concatenate([np.diff(time_s) > 0.0, [True]])
    sign = -1.0 if form.charge_is_positive else 1.0
    offset_K = ZERO_CELSIUS_K if form.temperature_unit == "degC" else 0.0

    def kelvin(role: str) -> Array | None:
        return values[role][keep] + offset_K if role in values else None

    recording = CyclerRecording(
        path,
        time_s[keep] - time_s[0],
        sign * values["current"][keep],
        values["voltage"][keep],
        kelvin("surface"),
        kelvin("ambient"),
        kelvin("core"),
        counted,
        int(np.sum(~keep)),
    )
    _require_plausible(recording, form)
    return recording


def write_own_columns(recording: CyclerRecording, path: Path) -> None:
    """Write the recording with the project's own column names and units as CSV."""
    columns = {
        "time_s": recording.time_s,
        "current_A": recording.current_A,
        "voltage_V": recording.voltage_V,
        "surface_temperature_K": recording.surface_K,
        "coolant_temperature_K": recording.ambient_K,
        "core_temperature_K": recording.core_K,
    }
    present = {name: values for name, values in columns.items() if values is not None}
    lines = [",".join(present)]
    lines += [",".join(f"{value:.9g}" for value in row) for row in zip(*present.values())]
    write_text(path, "\n".join(lines) + "\n")


def _columns(table: TextTable, form: CyclerFormat) -> dict[str, int]:
    """Places by role: of the first map that fits the file, else of the header's own names."""
    width = len(table.rows[0].cells)
    reasons = []
    for chosen in form.maps:
        places, reason = _places(chosen, table.header, width)
        if reason is None:
            return places
        reasons.append(reason)
    known = _known(table.header)
    if all(role in known for role in _NEEDED) and not (form.maps and not reasons):
        return known
    if not form.maps:
        raise InputError(
            f"{table.path}: its columns are not told by a header; "
            "give --columns, such as time=0,current=1,voltage=2,surface=4"
        )
    raise InputError(f"{table.path}: --columns: {reasons[0]}; give a --columns that fits this file")


def _places(
    chosen: ColumnMap, header: Sequence[str], width: int
) -> tuple[dict[str, int], str | None]:
    places = {}
    for role, place in chosen.columns.items():
        if isinstance(place, str):
            found = [index for index, name in enumerate(header) if name == place]
            if len(found) != 1:
                return {}, f"{role}: the header has no single column '{place}'"
            places[role] = found[0]
        elif place >= width:
            return {}, f"{role}={place}: the file has {width} columns, counted from 0"
        else:
            places[role] = place
    return places, None


def _known(header: Sequence[str]) -> dict[str, int]:
    places: dict[str, int] = {}
    plain = ["".join(c if c.isalnum() else " " for c in name.lower()).split() for name in header]
    for index, words in enumerate(plain):
        for role, names in _NAMES.items():
            if role not in places and " ".join(words) in names:
                places[role] = index
    return places


def _column(table: TextTable, role: str, place: int) -> Array:
    values = np.array([table.number(row, place) for row in table.rows])
    wrong = np.flatnonzero(~np.isfinite(values))
    if len(wrong):
        row = table.rows[int(wrong[0])]
        raise InputError(
            f"{table.path}:{row.line}: {role}: {row.cells[place].strip()!r} is not a finite "
            "number; mend or remove the row"
        )
    return values


def _time_s(
    table: TextTable, values: Mapping[str, Array], form: CyclerFormat
) -> tuple[Array, bool]:
    if "time" in values:
        time_s, counted = values["time"], False
    elif form.sample_period_s is None:
        raise InputError(
            f"{table.path}: has no time column; give --sample-period in s, the time between rows"
        )
    else:
        rows = values.get("row", np.arange(len(table.rows), dtype=np.float64))
        time_s, counted = rows * form.sample_period_s, True
    back = np.flatnonzero(np.diff(time_s) < 0.0)
    if len(back):
        line = table.rows[int(back[0]) + 1].line
        raise InputError(
            f"{table.path}:{line}: time goes back from {time_s[back[0]]:.10g} to "
            f"{time_s[back[0] + 1]:.10g}; choose the column of the total time, or sort the file"
        )
    if len(time_s) < 2 or math.isclose(float(time_s[0]), float(time_s[-1])):
        raise InputError(f"{table.path}: time does not pass; give a recording of many rows")
    return time_s, counted


def _require_plausible(recording: CyclerRecording, form: CyclerFormat) -> None:
    columns = {
        "time_s": recording.time_s,
        "current_A": recording.current_A,
    }
    for name, values in (
        ("surface_temperature_K", recording.surface_K),
        ("coolant_temperature_K", recording.ambient_K),
        ("core_temperature_K", recording.core_K),
    ):
        if values is not None:
            columns[name] = values
    try:
        require_plausible(str(recording.path), columns, recording.voltage_V)
    except InputError as error:
        raise InputError(_with_options(str(error), form)) from None


def _with_options(complaint: str, form: CyclerFormat) -> str:
    """The complaint with the option that mends it in place of a change of the file."""
    sign = "leave --charge-positive out" if form.charge_is_positive else "give --charge-positive"
    return complaint.replace(
        "likely degrees Celsius: add 273.15", "likely degrees Celsius: give --temperature-unit degC"
    ).replace("likely positive while charging: multiply it by -1", f"likely the other sign: {sign}")
