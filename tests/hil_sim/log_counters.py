"""Simple counters of what is in a log, for holding the readers' accounts against.

Each gives the range of numbers of entries that a log's bytes allow. They know no grammar: a line
is an entry unless it is blank, a comment or one of a few headers.
"""

from __future__ import annotations

import codecs
import re
import struct
import zlib
from collections.abc import Callable, Iterator

_DROPPED = re.compile(r"DROPCOUNT: dropped (\d+) CAN", re.IGNORECASE)
_BASE, _CONTAINER = struct.Struct("<4sHHLL"), struct.Struct("<H6xL4x")


def _lines(content: bytes) -> list[str]:
    is_utf_16 = content[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    text = content.decode("utf-16" if is_utf_16 else "utf-8-sig", "replace")
    return [line for line in re.split(r"\r\n|\r|\n", text) if line.strip()]


def _entries(content: bytes, comments: tuple[str, ...]) -> list[str]:
    return [line for line in _lines(content) if not line.lstrip().startswith(comments)]


def candump(content: bytes) -> range:
    lines = _entries(content, ("#", "//"))
    dropped = [int(match[1]) for line in lines if (match := _DROPPED.match(line.strip()))]
    details = sum(line.startswith("\t") for line in lines)
    most = len(lines) - len(dropped) + sum(dropped)
    return range(most - details, most + 1)


def asc(content: bytes) -> range:
    """At least what has a direction or is an error frame, at most all lines with a time."""
    lines = _entries(content, ("#", "//"))
    known = re.compile(r"\b(rx|tx|txrq|errorframe)\b", re.IGNORECASE)
    header = re.compile(
        r"\s*(date|base)\s|.*\b(triggerblock|internal event|log file)", re.IGNORECASE
    )
    return range(
        sum(bool(known.search(line)) and not header.match(line) for line in lines), len(lines) + 1
    )


def csv(content: bytes) -> range:
    lines = _entries(content, ("#", "//"))
    has_separator = bool(lines) and lines[0].strip().lower().startswith("sep=")
    has_header = len(lines) > has_separator and "time" in lines[has_separator].lower()
    count = len(lines) - has_separator - has_header
    return range(count, count + 1)


def trc(content: bytes) -> range:
    count = len(_entries(content, (";", "#", "//")))
    return range(count, count + 1)


def blf(content: bytes) -> range:
    (start,) = struct.unpack_from("<L", content, 4)
    inside, outside = b"", 0
    for kind, raw in _objects(content, start):
        if kind == 10:
            method, _ = _CONTAINER.unpack_from(raw, 16)
            inside += zlib.decompressobj().decompress(raw[32:]) if method == 2 else raw[32:]
        else:
            outside += 1
    count = outside + sum(1 for _ in _objects(inside, 0))
    return range(count, count + 1)


def _objects(data: bytes, position: int) -> Iterator[tuple[int, bytes]]:
    while (position := data.find(b"LOBJ", position)) >= 0 and position + 16 <= len(data):
        *_, size, kind = _BASE.unpack_from(data, position)
        yield kind, data[position : position + size]
        position += size


def mdf4(content: bytes) -> range:
    """Records of the channel groups, as their blocks state them."""
    count = 0
    for match in re.finditer(rb"##CG", content):
        if match.start() % 8 == 0 and match.start() + 88 <= len(content):
            count += struct.unpack_from("<Q", content, match.start() + 80)[0]
    return range(count, count + 1)


COUNTERS: dict[str, Callable[[bytes], range]] = {
    ".log": candump,
    ".asc": asc,
    ".csv": csv,
    ".trc": trc,
    ".blf": blf,
    ".mf4": mdf4,
}
