"""What a terminal that knows ASCII alone gets."""

from __future__ import annotations

import io
import sys

import pytest

from bms.plain_text import write_plainly


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("12.3 K – 0.5 K", b"12.3 K - 0.5 K"),
        ("3 µs", b"3 us"),
        ("cut…", b"cut~"),
        ("Zürich", b"Z?rich"),
        ("name \udcc3\udcbc.log", b"name \xc3\xbc.log"),
    ],
)
def test_what_ascii_lacks_is_written_by_its_nearest(
    text: str, written: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    with pytest.raises(UnicodeEncodeError):
        sys.stdout.write(text)
    write_plainly()
    sys.stdout.write(text)
    sys.stdout.flush()
    assert raw.getvalue() == written


def test_a_terminal_of_unicode_gets_everything_and_the_bytes_of_a_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stderr", io.TextIOWrapper(raw, encoding="utf-8"))
    write_plainly()
    sys.stderr.write("3 µs – \udcff")
    sys.stderr.flush()
    assert raw.getvalue() == "3 µs – ".encode() + b"\xff"
