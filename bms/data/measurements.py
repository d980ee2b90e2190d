"""Measured data from CSV files."""

from __future__ import annotations

import csv
import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from bms.arrays import Array
from bms.data.lags import Lags, at_rest, step
from bms.data.recording_plausibility import require_plausible
from bms.data.simulate import Samples
from bms.errors import InputError
from bms.validation import read_text


@dataclass(frozen=True)
class Measurements:
    """A recording, all arrays of shape (N,); the current is negative while charging."""

    time_s: Array
    current_A: Array
    cooling_power_W: Array
    surface_temperature_K: Array
    coolant_temperature_K: Array
    core_temperature_K: Array

    @property
    def has_copied_core(self) -> bool:
        """Whether the core's column equals the surface's in every one of several rows."""
        return len(self.time_s) > 1 and np.array_equal(
            self.core_temperature_K, self.surface_temperature_K
        )

    def samples(self, lags: Lags = ()) -> Samples:
        """The recording as samples of one profile, inputs in the estimator's order.

        Lagged inputs follow the four; the recording is taken to begin at rest, and the current of a
        row to flow until the next one, as in simulated profiles.
        """
        inputs = np.stack(
            [
                self.current_A,
                self.cooling_power_W,
                self.surface_temperature_K,
                self.coolant_temperature_K,
            ],
            axis=1,
        )
        if lags:
            inputs = np.hstack([inputs, self._filtered(lags)])
        return Samples(
            inputs, self.core_temperature_K, np.zeros(len(inputs), dtype=np.int64), self.time_s
        )

    def _filtered(self, lags: Lags) -> Array:
        """Lagged inputs (N, lags)."""
        values = at_rest(lags, 1)
        rows = [values[:, 0]]
        changes_K = np.diff(self.surface_temperature_K)
        for step_s, current_A, change_K in zip(
            np.diff(self.time_s), self.current_A[:-1], changes_K
        ):
            values = step(lags, values, float(step_s), float(current_A), float(change_K))
            rows.append(values[:, 0])
        return np.array(rows)


COLUMNS = tuple(field.name for field in fields(Measurements))
_VOLTAGE = "voltage_V"
_FOREIGN_SEPARATORS = {";": "';'", "\t": "tabulators"}


def read_measurements(path: Path, *, core_may_be_copied: bool = False) -> Measurements:
    """Recording from a CSV file with a header row; columns beyond the six are ignored.

    Raises InputError as read_columns does, and for a core that is the surface's copy.
    """
    recording = Measurements(*read_columns(path, COLUMNS))
    if recording.has_copied_core and not core_may_be_copied:
        raise InputError(
            f"{path}: core_temperature_K: {recording.core_temperature_K[0]:.6g} K and so on, equal "
            "to surface_temperature_K in every row; likely its copy: give the measured core"
        )
    return recording


def read_voltage(path: Path) -> Array | None:
    """Column voltage_V (N,) of a recording that read_measurements took; None where it has gaps."""
    rows = csv.DictReader(read_text(path).lstrip("\ufeff").splitlines())
    rows.fieldnames = [name.strip() for name in rows.fieldnames or []]
    voltage_V = np.array([_number_or_nan(row.get(_VOLTAGE) or "") for row in rows])
    return voltage_V if np.all(np.isfinite(voltage_V)) else None


def read_columns(path: Path, columns: Sequence[str]) -> Array:
    """Columns of a CSV file with a header row, time_s first, as an array (columns, rows).

    Of other columns only voltage_V is looked at: it tells which way the current flows. Raises
    InputError, with file and line, for a missing column, a row of another length, text or a value
    that is not finite in place of a number, and time that does not rise; and, with the column, for
    values in another unit or with the other sign.
    """
    rows = csv.reader(read_text(path).lstrip("\ufeff").splitlines())
    header = [name.strip() for name in _next_row(rows, path) or []]
    missing = [name for name in columns if header.count(name) != 1]
    if missing:
        for separator, name in _FOREIGN_SEPARATORS.items():
            if len(header) == 1 and separator in header[0]:
                raise InputError(
                    f"{path}:1: its columns are separated by {name}; separate them by commas, "
                    "with points in the numbers"
                )
        raise InputError(
            f"{path}:1: column {missing[0]} must be there once; "
            f"give a CSV file with the columns {', '.join(columns)}"
        )
    places = [header.index(name) for name in columns]
    voltage_place = header.index(_VOLTAGE) if header.count(_VOLTAGE) == 1 else None
    values: list[list[float]] = []
    voltage_V: list[float] = []
    while (cells := _next_row(rows, path)) is not None:
        if not cells:
            continue
        where = f"{path}:{rows.line_num}"
        if len(cells) != len(header):
            raise InputError(
                f"{where}: {len(cells)} values where the header has {len(header)}; mend the row"
            )
        values.append([_number(cells[place], header[place], where) for place in places])
        if voltage_place is not None:
            voltage_V.append(_number_or_nan(cells[voltage_place]))
        if len(values) > 1 and values[-1][0] <= values[-2][0]:
            remedy = (
                "remove one of the two rows"
                if values[-1][0] == values[-2][0]
                else "sort the file by time"
            )
            raise InputError(f"{where}: time_s must rise from row to row; {remedy}")
    if not values:
        raise InputError(f"{path}: holds no measurement; give a file with at least one row")
    found = np.array(values).T.copy()
    require_plausible(
        str(path), dict(zip(columns, found)), np.array(voltage_V) if voltage_V else None
    )
    return found


def recording_sha256(path: Path) -> str:
    """SHA-256 of a recording's file as hexadecimal text; InputError when it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None


def _next_row(rows: Iterator[list[str]], path: Path) -> list[str] | None:
    try:
        return next(rows, None)
    except csv.Error as error:
        raise InputError(f"{path}: not valid CSV: {error}; mend the file") from None


def _number_or_nan(text: str) -> float:
    try:
        # Python alone takes 1_000 for a number.
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan


def _number(text: str, name: str, where: str) -> float:
    value = _number_or_nan(text)
    if not math.isfinite(value):
        raise InputError(
            f"{where}: {name}: {text.strip()!r} is not a finite number; mend or remove the row"
        )
    return value
