"""Each row of the closing table names a test that there is."""

from __future__ import annotations

import re

import pytest

from tests.docs.pages import ROOT

PAGE = ROOT / "docs" / "foreign-input.md"
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.read_text(encoding="utf-8").splitlines()
    if line.startswith("|") and not line.startswith(("| kind", "|---"))
]


def test_the_table_has_its_four_columns_filled() -> None:
    assert len(ROWS) > 20
    assert all(len(row) == 4 and all(row) for row in ROWS)


@pytest.mark.parametrize("row", ROWS, ids=[row[0] for row in ROWS])
def test_the_row_names_a_test(row: list[str]) -> None:
    named = re.fullmatch(r"`(tests/[\w/]+\.py)` `(test_\w+)`", row[3])
    assert named is not None
    source = (ROOT / named[1]).read_text(encoding="utf-8")
    assert re.search(rf"^def {named[2]}\(", source, re.MULTILINE)
