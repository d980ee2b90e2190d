"""Tables on the terminal: one look for all commands, and one rule for narrow terminals.

A number is never cut. A cell that begins with one stays in one line with its unit; other text wraps
between its words. Where that does not fit, the columns go into several tables, one below the
other, each with the leading columns that tell the rows apart. Only a table whose longest words do
not fit has longer lines than the terminal.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from rich.box import SIMPLE
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

_NUMBER = re.compile(r"[-+]?\.?\d")
_LONGEST_NUMBER = 20
"""Beyond this width what begins with a digit is a sentence."""
_GAP = 2
"""Blanks between two columns."""

Cell = str | Text


def red(text: str) -> Text:
    """A cell that shows what is wrong."""
    return Text(text, style="red")


class TextTable:
    """Rows of plain or styled text below headings; the columns of numbers stand to the right."""

    def __init__(self, *headings: str, title: str = "", caption: str = "") -> None:
        self._headings = headings
        self._title = title
        self._caption = caption
        self._rows: list[tuple[Text, ...]] = []
        self._styles: list[str] = []
        self._ends: set[int] = set()

    def add_row(self, *cells: Cell, style: str = "") -> None:
        """A row of as many cells as there are headings."""
        if len(cells) != len(self._headings):
            raise ValueError(f"{len(cells)} cells below {len(self._headings)} headings")
        self._rows.append(tuple(c if isinstance(c, Text) else Text(c) for c in cells))
        self._styles.append(style)

    def add_section(self) -> None:
        """What follows stands apart from the rows so far."""
        self._ends.add(len(self._rows) - 1)

    def print(self, console: Console | None = None) -> None:
        """Print as many tables as the width needs; standard output unless told otherwise."""
        console = console or Console()
        if self._title:
            console.print(Text(self._title, style="bold"), soft_wrap=True)
        for columns in self._parts(console.width):
            console.print(self._table(columns, console.width), crop=False)
            console.print()
        if self._caption:
            console.print(Text(self._caption, style="dim"), soft_wrap=True)

    def _table(self, columns: Sequence[int], width: int) -> Table:
        gaps = _GAP * (len(columns) - 1)
        widths = _shared(
            [self._least(column) for column in columns],
            [self._most(column) for column in columns],
            width - gaps,
        )
        table = Table(
            box=SIMPLE,
            show_edge=False,
            pad_edge=False,
            padding=(0, _GAP - 1, 0, 0),
            width=sum(widths) + gaps,
        )
        for column, own in zip(columns, widths):
            is_right = column > 0 and self._is_of_numbers(column)
            table.add_column(
                Text(self._headings[column]), justify="right" if is_right else "left", width=own
            )
        for number, (row, style) in enumerate(zip(self._rows, self._styles)):
            cells = [row[column] for column in columns]
            table.add_row(*cells, style=style, end_section=number in self._ends)
        return table

    def _parts(self, width: int) -> list[list[int]]:
        """Columns of each of the tables."""
        keys = list(range(self._keys()))
        parts = [[*keys]]
        for column in range(len(keys), len(self._headings)):
            is_too_wide = self._least_width([*parts[-1], column]) > width
            if is_too_wide and len(parts[-1]) > len(keys):
                parts.append([*keys])
            parts[-1].append(column)
        return parts

    def _least_width(self, columns: Sequence[int]) -> int:
        return sum(self._least(column) for column in columns) + _GAP * (len(columns) - 1)

    def _keys(self) -> int:
        """How many leading columns tell the rows apart; 1 where only all of them would."""
        for keys in range(1, len(self._headings)):
            different = {tuple(cell.plain for cell in row[:keys]) for row in self._rows}
            if len(different) == len(self._rows):
                return keys
        return 1

    def _texts(self, column: int) -> list[str]:
        return [row[column].plain for row in self._rows]

    def _is_of_numbers(self, column: int) -> bool:
        texts = [text for text in self._texts(column) if text]
        return 2 * sum(map(_is_number, texts)) >= len(texts) > 0

    def _least(self, column: int) -> int:
        pieces = self._headings[column].split()
        for text in self._texts(column):
            pieces += [text] if _is_number(text) else text.split()
        return max(map(cell_len, pieces), default=1)

    def _most(self, column: int) -> int:
        lines = "\n".join([self._headings[column], *self._texts(column)]).splitlines()
        return max(map(cell_len, lines), default=1)


def _is_number(text: str) -> bool:
    return _NUMBER.match(text) is not None and cell_len(text) <= _LONGEST_NUMBER


def _shared(least: Sequence[int], most: Sequence[int], room: int) -> list[int]:
    """Widths that share the room, the widest columns giving way first, none below its least."""
    for level in range(max(most), 0, -1):
        widths = [max(low, min(high, level)) for low, high in zip(least, most)]
        if sum(widths) <= room:
            return widths
    return list(least)
