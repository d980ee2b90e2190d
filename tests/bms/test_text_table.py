"""Tables on the terminal: however narrow it is, no number and no word is cut."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from bms.text_table import TextTable, red

ROOT = Path(__file__).parents[2]


def printed(table: TextTable, width: int, encoding: str = "utf-8") -> list[str]:
    """Lines as a terminal of this width gets them, without the blanks at their ends."""
    raw = io.BytesIO()
    file = io.TextIOWrapper(raw, encoding=encoding, write_through=True)
    table.print(Console(file=file, width=width))
    return [line.rstrip() for line in raw.getvalue().decode(encoding).splitlines()]


def peaks() -> TextTable:
    table = TextTable("", "kan-rcbf", "s-cbf", "limit", title="Peaks of a charge")
    table.add_row("largest temperature of the core", "322.97 K", red("323.41 K"), "323.00 K")
    table.add_row("charging time", "788.5 s", "-", "")
    return table


def test_wide_terminal_gets_one_table() -> None:
    assert printed(peaks(), 80) == [
        "Peaks of a charge",
        "                                 kan-rcbf     s-cbf     limit",
        "─────────────────────────────────────────────────────────────",
        "largest temperature of the core  322.97 K  323.41 K  323.00 K",
        "charging time                     788.5 s         -",
        "",
    ]


def test_words_wrap_first() -> None:
    assert printed(peaks(), 45) == [
        "Peaks of a charge",
        "                 kan-rcbf     s-cbf     limit",
        "─────────────────────────────────────────────",
        "largest          322.97 K  323.41 K  323.00 K",
        "temperature of",
        "the core",
        "charging time     788.5 s         -",
        "",
    ]


def test_then_columns_go_below_each_other() -> None:
    assert printed(peaks(), 31) == [
        "Peaks of a charge",
        "             kan-rcbf     s-cbf",
        "───────────────────────────────",
        "largest      322.97 K  323.41 K",
        "temperature",
        "of the core",
        "charging      788.5 s         -",
        "time",
        "",
        "                          limit",
        "───────────────────────────────",
        "largest temperature    323.00 K",
        "of the core",
        "charging time",
        "",
    ]


def test_every_part_has_the_columns_that_tell_the_rows_apart() -> None:
    table = TextTable("model", "edge", "worst error", "stated bound")
    for model in ("lin2014", "paper"):
        for edge in ("0", "1"):
            table.add_row(model, edge, f"1.{edge}e-09", "8.831e-09")
        table.add_section()
    assert printed(table, 24) == [
        "                   worst",
        "model    edge      error",
        "────────────────────────",
        "lin2014     0    1.0e-09",
        "lin2014     1    1.1e-09",
        "",
        "paper       0    1.0e-09",
        "paper       1    1.1e-09",
        "",
        "                  stated",
        "model    edge      bound",
        "────────────────────────",
        "lin2014     0  8.831e-09",
        "lin2014     1  8.831e-09",
        "",
        "paper       0  8.831e-09",
        "paper       1  8.831e-09",
        "",
    ]


def test_a_terminal_that_knows_ascii_alone_gets_the_same_figures() -> None:
    lines = printed(peaks(), 60, "ascii")
    assert "322.97 K |323.41 K |323.00 K" in lines[3]
    assert max(map(len, lines)) <= 60


def test_brackets_are_no_markup() -> None:
    table = TextTable("[bold]", title="[red]cell[/red]")
    table.add_row("[3]")
    assert printed(table, 40) == ["[red]cell[/red]", "[bold]", "──────", "[3]", ""]


def test_row_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="1 cells below 2 headings"):
        TextTable("a", "b").add_row("1")


WORDS = st.text("abcdefg/_", min_size=1, max_size=14)
NUMBERS = st.one_of(
    st.floats(-1e6, 1e6).map("{:+.4f} K".format),
    st.floats(0.0, 9.0).map("{:.2g} .. 9 ms".format),
    st.integers(0, 10**12).map(str),
)
SENTENCES = st.lists(st.one_of(WORDS, NUMBERS), min_size=1, max_size=5).map(" ".join)


@given(
    cells=st.integers(1, 6).flatmap(
        lambda n: st.lists(
            st.lists(st.one_of(NUMBERS, SENTENCES), min_size=n, max_size=n), min_size=1, max_size=4
        )
    ),
    width=st.integers(20, 120),
)
def test_no_word_is_cut_and_no_number_parted_from_its_unit(
    cells: list[list[str]], width: int
) -> None:
    headings = [f"heading {chr(65 + number)}" for number in range(len(cells[0]))]
    table = TextTable(*headings)
    for row in cells:
        table.add_row(*row)
    lines = printed(table, width)
    text = "\n".join(lines)
    shown = text.split()
    for row in cells:
        for cell in row:
            assert set(cell.split()) <= set(shown)
            if re.fullmatch(r"[-+]?[\d.]+( (K|.. 9 ms))?", cell) and len(cell) <= 20:
                assert cell in text
    assert "…" not in text
    # Three columns of the longest words here, and the gaps between them, always fit.
    if width >= 3 * 20 + 4 and len(headings) <= 3:
        assert max(map(len, lines)) <= width


def test_no_command_has_tables_of_its_own() -> None:
    """The monitor is a screen: it is cut where the terminal ends, and shows what matters first."""
    users = {
        str(path.relative_to(ROOT))
        for wing in ("bms", "codegen", "hil_sim")
        for path in (ROOT / wing).rglob("*.py")
        if re.search(r"^\s*(from|import) rich\.table", path.read_text("utf-8"), re.MULTILINE)
    }
    monitor = {path for path in users if path.startswith("hil_sim/monitor/")}
    assert users - monitor == {"bms/text_table.py"}
