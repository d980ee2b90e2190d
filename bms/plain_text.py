"""Output where the locale knows ASCII alone, as with LANG=C: words instead of an error."""

from __future__ import annotations

import codecs
import io
import sys

_HANDLER = "bms.plain_text"
_PLAIN = {"–": "-", "—": "-", "−": "-", "µ": "u", "μ": "u", "…": "~", "×": "x", "·": "."}
"""One for one, so that what is laid out in columns stays so."""
_ESCAPED = range(0xDC80, 0xDD00)
"""Python's stand-ins for bytes of a file's name that the locale does not know."""


def write_plainly() -> None:
    """Let standard output and error write what their encoding lacks in ASCII, or as '?'."""
    codecs.register_error(_HANDLER, _plain)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_HANDLER)


def _plain(error: UnicodeError) -> tuple[bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return b"".join(map(_instead, lacking)), error.end


def _instead(character: str) -> bytes:
    if ord(character) in _ESCAPED:
        return bytes([ord(character) - 0xDC00])
    return _PLAIN.get(character, "?").encode("ascii")
