"""What text logs have in common: compression, encoding, lines and the end of the file.

Of the encoding only comments and names of channels depend; so what is not UTF-8 (a comment in
Latin-1) is no reason to refuse a log.
"""

from __future__ import annotations

import codecs
import copy
import gzip
import shlex
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from io import BufferedReader, TextIOWrapper
from pathlib import Path
from typing import Protocol

from hil_sim.logs.formats import is_compressed
from hil_sim.logs.frame import CutOffError, Entry, Unread, UnreadableError

MAX_LINE = 1 << 16
"""Characters of a line; the longest entry of a format, a CAN XL frame, has some 4,000."""
_UTF_16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_COMMENTS = ("#", "//")
_CONTINUATIONS = ("0", "1", "00", "000", " 00", ",00", " T", "#0", "_9", " RTR", " remote request")
"""What could follow at the end of a line that lacks its end, were it cut off there."""


class LineParser(Protocol):
    """The grammar of a text format; it may depend on the lines before."""

    delta_times: bool
    """Whether the file says that each time counts from the line before."""

    def parse(self, line: str) -> Entry | None:
        """The entry of a line that is not blank, None for one that holds none.

        Raises UnreadableError for a line that is none of the format's.
        """
        ...


def text_entries(path: Path, parser: LineParser) -> Iterator[tuple[int, Entry]]:
    """The line of each entry, and the entry.

    Raises UnreadableError, with the line where it can be told, and OSError.
    """
    with ExitStack() as stack:
        file: BufferedReader | gzip.GzipFile = stack.enter_context(path.open("rb"))
        if is_compressed(path):
            file = stack.enter_context(gzip.GzipFile(fileobj=file))
        number = 0
        try:
            for number, line in enumerate(_lines(file), start=1):
                if len(line) > MAX_LINE:
                    raise UnreadableError(f"it is longer than {MAX_LINE} characters")
                if not line.strip() or line.lstrip().startswith(_COMMENTS):
                    continue
                if not line.endswith("\n") and _may_go_on(line, parser):
                    raise CutOffError(
                        "it has no end, so that it may be cut off",
                        _remedy_of_last_line(path),
                    )
                entry = parser.parse(line)
                if entry is not None:
                    yield number, entry
        except UnreadableError as error:
            error.where = f"line {number}"
            raise
        except EOFError:
            raise CutOffError(f"cut off in the compressed text after line {number}") from None
        except (gzip.BadGzipFile, zlib.error):
            raise UnreadableError(f"its gzip data are damaged after line {number}") from None


def _lines(file: BufferedReader | gzip.GzipFile) -> Iterator[str]:
    encoding = "utf-16" if file.peek(2)[:2] in _UTF_16_MARKS else "utf-8-sig"
    text = TextIOWrapper(file, encoding=encoding, errors="backslashreplace")
    while line := text.readline(MAX_LINE + 1):
        yield line


def _may_go_on(line: str, parser: LineParser) -> bool:
    """Whether the last line could be the beginning of another entry than it seems to be."""

    def read(text: str) -> Entry | None:
        return copy.copy(parser).parse(text)

    try:
        entry = read(line)
    except UnreadableError:
        return True
    if entry is not None and entry.unread is Unread.OTHER_ENTRIES and entry.number:
        return True
    for more in _CONTINUATIONS:
        try:
            if read(line + more) != entry:
                return True
        except UnreadableError:
            continue
    return False


def head_command(path: Path, line: int) -> str:
    """A shell command that keeps a log up to a line, in a file beside it."""
    is_gzip = is_compressed(path)
    kept = path.with_name(f"whole-{path.stem if is_gzip else path.name}")
    log, out = shlex.quote(str(path)), shlex.quote(str(kept))
    return f"zcat {log} | head -n {line} > {out}" if is_gzip else f"head -n {line} {log} > {out}"


def _remedy_of_last_line(path: Path) -> str:
    name = shlex.quote(str(path))
    if is_compressed(path):
        return f"if it is whole, add its end: echo | gzip >> {name}"
    return f"if it is whole, add its end: echo >> {name}; else remove it: sed -i '$d' {name}"
