"""What a file of the wrong suffix looks like, so that the refusal can say how to name it."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

from hil_sim.logs.formats import GZIP_SUFFIX, LogFormat, is_compressed

_HEAD_BYTES = 4096
_GZIP_MARK = b"\x1f\x8b"
_FLAGS = re.MULTILINE | re.IGNORECASE
_SIGNS = (
    (".blf", re.compile(rb"\ALOGG")),
    (".mf4", re.compile(rb"\AMDF ")),
    (".log", re.compile(rb"^\(\d+\.\d+\) +\S+ +[\dA-F]{3,8}#", _FLAGS)),
    (".log", re.compile(rb"^ *(\(\d+\.\d+\) +)?\S+ +[\dA-F]{3,8} +\[\d\] ", _FLAGS)),
    (".trc", re.compile(rb"^;\$FILEVERSION|^;.*PCAN", _FLAGS)),
    (".csv", re.compile(rb"^timestamp[,;]arbitration_id|^time stamp[,;]ID", _FLAGS)),
    (".asc", re.compile(rb"^date |^base +(hex|dec)|^ *\d+\.\d+ +\d+ +\w+ +[RT]x +d ", _FLAGS)),
)
_CONVERTED = (
    (re.compile(rb"\*\*\*BUSMASTER"), "a log of BUSMASTER", "save it as ASC in BUSMASTER"),
    (re.compile(rb"\APK\x03\x04"), "a ZIP archive", "unpack it"),
    (re.compile(rb"\ASQLite format 3"), "a database of python-can", "name it .db and run "
     "'python -m can.logconvert FILE.db FILE.log'"),
    (re.compile(rb"\A(\x0a\x0d\x0d\x0a|\xd4\xc3\xb2\xa1)"), "a capture of Wireshark",
     "record it with 'candump -L'"),
)  # fmt: skip


def what_it_looks_like(path: Path, form: LogFormat) -> str:
    """What the file seems to be and how to go on; empty if it may well be what its suffix says."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    is_gzip = head.startswith(_GZIP_MARK)
    if is_gzip:
        head = _unpacked(head)
    for sign, what, remedy in _CONVERTED:
        if sign.search(head):
            return f"it looks like {what}: {remedy}"
    seen = next((suffix for suffix, sign in _SIGNS if sign.search(head)), form.suffix)
    suffix = seen + GZIP_SUFFIX * is_gzip
    if suffix == form.suffix + GZIP_SUFFIX * is_compressed(path):
        return ""
    stem = path.with_suffix("").stem if is_compressed(path) else path.stem
    return f"it looks like '{suffix}': name it {path.with_name(stem + suffix)}"


def _unpacked(head: bytes) -> bytes:
    try:
        return zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(head, _HEAD_BYTES)
    except zlib.error:
        return b""
