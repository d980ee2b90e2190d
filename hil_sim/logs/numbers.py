"""Numbers of text logs, read strictly: what Python's own conversions would let pass is refused."""

from __future__ import annotations

import re
from collections.abc import Sequence

from hil_sim.logs.frame import UnreadableError

LONG_DLCS = range(9, 16)
"""Raw DLCs of classical frames that carry 8 bytes all the same."""

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?", re.ASCII | re.IGNORECASE)
_HEX = re.compile(r"[0-9A-F]+", re.ASCII | re.IGNORECASE)
_HEX_BYTE = re.compile(r"[0-9A-F]{2}", re.ASCII | re.IGNORECASE)


def seconds(text: str) -> float:
    """A decimal number; UnreadableError for anything else."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        raise UnreadableError(f"'{text[:40]}' is not a time")
    return float(text)


def whole(text: str, base: int = 10) -> int:
    """A number without sign; UnreadableError for anything else."""
    pattern = _HEX if base == 16 else _NUMBER
    if not pattern.fullmatch(text) or (base == 10 and not text.isdigit()) or len(text) > 20:
        raise UnreadableError(f"'{text[:40]}' is not a number")
    return int(text, base)


def hex_bytes(words: Sequence[str], count: int) -> bytes:
    """Bytes of two hexadecimal digits each; UnreadableError for others or another number."""
    if len(words) != count:
        raise UnreadableError(f"{count} bytes are announced, {len(words)} are there")
    if not all(map(_HEX_BYTE.fullmatch, words)):
        raise UnreadableError("its data are not bytes of two hexadecimal digits")
    return bytes.fromhex("".join(words))
