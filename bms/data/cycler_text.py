"""Rows of a text file as cyclers write them: any separator, decimal comma, mark, preamble."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bms.errors import InputError

_ENCODINGS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
_SEPARATORS = ("\t", ";", "|", ",")
_CLOCK = re.compile(r"^(?:(\d+)[d ]\s*)?(\d+):(\d{2}):(\d{2}(?:[.,]\d+)?)$")
_MOST_PREAMBLE = 400
_SAMPLE_LINES = 60


@dataclass(frozen=True)
class TextRow:
    """Cells of one line, and its number in the file from 1."""

    line: int
    cells: tuple[str, ...]


@dataclass(frozen=True)
class TextTable:
    """Header (empty where there is none) and rows of numbers of one file."""

    path: Path
    header: tuple[str, ...]
    rows: tuple[TextRow, ...]
    has_decimal_comma: bool

    def number(self, row: TextRow, place: int) -> float:
        """Number of a cell; NaN for what is none."""
        return number(row.cells[place], has_decimal_comma=self.has_decimal_comma)


def number(text: str, *, has_decimal_comma: bool = False) -> float:
    """Number of a cell, durations such as 1:02:03.5 in seconds; NaN for what is none."""
    text = text.strip().strip('"').strip()
    clock = _CLOCK.match(text)
    if clock is not None:
        days, hours, minutes, seconds = clock.groups()
        day_s = 86400.0 * float(days or 0)
        return (
            day_s + 3600.0 * float(hours) + 60.0 * float(minutes) + float(seconds.replace(",", "."))
        )
    if has_decimal_comma:
        text = text.replace(".", "").replace(",", ".") if text.count(",") == 1 else text
    try:
        # Python alone takes 1_000 for a number.
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan


def read_table(path: Path) -> TextTable:
    """Header and rows of a file whose separator, decimal sign and preamble are found out.

    The rows begin with the first line that is numbers in more than half of its cells, as the next
    one is; the line before is the header. InputError names file and line of what is no table.
    """
    lines = _text(path).splitlines()
    separator = _separator(lines, path)
    rows = [
        TextRow(place + 1, _cells(line, separator))
        for place, line in enumerate(lines)
        if line.strip()
    ]
    comma = separator != "," and _has_decimal_comma(rows)
    begin = _first_numbers(rows, has_decimal_comma=comma)
    if begin is None:
        raise InputError(
            f"{path}: no line of numbers in its first {_MOST_PREAMBLE} lines; "
            "give a text file with one row for each sample"
        )
    header = rows[begin - 1].cells if begin > 0 else ()
    data = rows[begin:]
    width = len(data[0].cells)
    # A separator at the end of each line makes an empty last cell in some rows or the header alone.
    for row in data:
        if len(row.cells) != width and not (
            len(row.cells) == width + 1 and not row.cells[-1].strip()
        ):
            raise InputError(
                f"{path}:{row.line}: {len(row.cells)} values where the first row has {width}; "
                "mend or remove the row"
            )
    return TextTable(
        path,
        tuple(cell.strip().strip('"').strip() for cell in header),
        tuple(data),
        comma,
    )


def _text(path: Path) -> str:
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    if b"\0" in content and content[:2] not in _ENCODINGS:
        raise InputError(
            f"{path}: not a text file; export the recording from the cycler as CSV or TXT"
        )
    encoding = _ENCODINGS.get(content[:2], "utf-8-sig")
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        # Older cyclers write the degree sign in the code page of Windows.
        return content.decode("latin-1")


def _separator(lines: Sequence[str], path: Path) -> str | None:
    """The separator with which most of the last lines have one number of cells; None: blanks."""
    tail = [line for line in lines if line.strip()][-_SAMPLE_LINES:]
    if not tail:
        raise InputError(f"{path}: holds no measurement; give a file with at least one row")
    for separator in _SEPARATORS:
        counts = Counter(line.count(separator) for line in tail)
        most, share = counts.most_common(1)[0]
        if most > 0 and share > 0.5 * len(tail):
            return separator
    return None


def _cells(line: str, separator: str | None) -> tuple[str, ...]:
    return tuple(line.split(separator) if separator else line.split())


def _has_decimal_comma(rows: Sequence[TextRow]) -> bool:
    tail = [cell for row in rows[-_SAMPLE_LINES:] for cell in row.cells]
    commas = sum(bool(re.match(r"^\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*$", cell)) for cell in tail)
    points = sum(bool(re.match(r"^\s*[+-]?\d+\.\d+(?:[eE][+-]?\d+)?\s*$", cell)) for cell in tail)
    return commas > points


def _first_numbers(rows: Sequence[TextRow], *, has_decimal_comma: bool) -> int | None:
    def is_numbers(row: TextRow) -> bool:
        filled = [cell for cell in row.cells if cell.strip()]
        found = sum(
            not math.isnan(number(cell, has_decimal_comma=has_decimal_comma)) for cell in filled
        )
        return found >= 2 and found > 0.5 * len(filled)

    for place, row in enumerate(rows[:_MOST_PREAMBLE]):
        following = rows[place + 1] if place + 1 < len(rows) else row
        if is_numbers(row) and is_numbers(following) and len(following.cells) == len(row.cells):
            return place
    return None
