"""candump's two outputs: the log (candump -L) and what it shows on a terminal.

python-can has a reader of the first alone. It takes a frame with a raw DLC, a CAN XL frame and a
count of dropped frames for damage, and most error frames for data frames; hence this grammar.
Source: can-utils, lib.c (snprintf_canframe, snprintf_long_canframe) and candump.c.
"""

from __future__ import annotations

import re
from datetime import datetime, timezone

from hil_sim.bus.limits import MAX_DATA_LENGTH
from hil_sim.logs.frame import Entry, Unread, UnreadableError
from hil_sim.logs.numbers import hex_bytes, seconds

_ERROR_FLAG, _HIGHEST_FLAGGED_ID = 0x20000000, 0x3FFFFFFF
_STANDARD_DIGITS = 3
_FLAGS = re.ASCII | re.IGNORECASE
_ID = r"(?P<id>[0-9A-F]{8}|[0-9A-F]{3})"
_LOG = re.compile(
    rf"\((?P<time>[^()]*)\)\s+(?P<channel>\S+)\s+{_ID}#(?P<content>\S*)(?:\s+(?P<direction>[RT]))?",
    _FLAGS,
)
_XL = re.compile(
    r"\((?P<time>[^()]*)\)\s+(?P<channel>\S+)\s+[0-9A-F]{5}#"
    r"[0-9A-F]{2}:[0-9A-F]{2}:[0-9A-F]{8}#(?:[0-9A-F]{2})+(?:\s+[RT])?",
    _FLAGS,
)
_CLASSICAL = re.compile(r"(?P<data>(?:[0-9A-F]{2}){0,8})(?P<raw_dlc>_[9A-F])?", _FLAGS)
_REMOTE = re.compile(r"R[0-8]?(?:_[9A-F])?", _FLAGS)
_FD = re.compile(r"#[0-9A-F](?:[0-9A-F]{2}){0,64}", _FLAGS)
_TERMINAL = re.compile(
    rf"(?:\((?P<time>[^()]*)\)\s+)?(?P<channel>\S+)\s+(?:(?P<direction>[RT])X\s+[B-]\s+[E-]\s+)?"
    rf"{_ID}\s+(?:\[(?P<length>\d+)\]|\{{(?P<raw_dlc>[9A-F])\}})(?P<content>(?:\s.*)?)",
    _FLAGS,
)
_SHOWN_DATA = re.compile(r"(?P<data>(?:\s+[0-9A-F]{2})*)(?:\s+(?P<rest>'.*'|ERRORFRAME))?", _FLAGS)
_DROPPED = re.compile(r"DROPCOUNT: dropped (?P<count>\d{1,18}) CAN frames? on ", _FLAGS)
_COLOUR = re.compile(r"\x1b\[[\d;]*m")


class CandumpParser:
    """Lines of either output, which may be mixed."""

    delta_times = False

    def __init__(self) -> None:
        self._after_error = False

    def parse(self, line: str) -> Entry | None:
        """The line's entry; UnreadableError for a line that is none of candump's."""
        if self._after_error and line.startswith("\t"):
            return None  # what an error frame means, with candump -e
        text = _COLOUR.sub("", line).strip()
        entry = self._entry(text)
        self._after_error = entry.unread is Unread.ERROR_FRAMES
        return entry

    def _entry(self, text: str) -> Entry:
        if match := _LOG.fullmatch(text):
            return _log_entry(match)
        if match := _TERMINAL.fullmatch(text):
            return _terminal_entry(match)
        if match := _XL.fullmatch(text):
            return Entry(_time_s(match["time"]), match["channel"], unread=Unread.CAN_XL_FRAMES)
        if match := _DROPPED.match(text):
            return Entry(None, unread=Unread.LOST_FRAMES, number=int(match["count"]))
        raise UnreadableError("neither a frame nor a comment")


def _log_entry(match: re.Match[str]) -> Entry:
    frame_id, is_extended, is_error = _identifier(match["id"])
    content, data, unread = match["content"], b"", None
    if is_error:
        unread = Unread.ERROR_FRAMES
    elif classical := _CLASSICAL.fullmatch(content):
        data = bytes.fromhex(classical["data"])
        if classical["raw_dlc"]:
            if len(data) != MAX_DATA_LENGTH:
                raise UnreadableError("a raw DLC goes with 8 bytes")
            unread = Unread.LONG_DLC_FRAMES
    elif _FD.fullmatch(content):
        unread = Unread.CAN_FD_FRAMES
    elif _REMOTE.fullmatch(content):
        unread = Unread.REMOTE_FRAMES
    else:
        raise UnreadableError(f"'{content[:40]}' is not the data of a CAN frame")
    received = match["direction"] not in ("T", "t")
    time_s = _time_s(match["time"])
    return Entry(time_s, match["channel"], frame_id, data, is_extended, received, unread)


def _terminal_entry(match: re.Match[str]) -> Entry:
    frame_id, is_extended, is_error = _identifier(match["id"])
    length, data, unread = match["length"], b"", None
    shown = _SHOWN_DATA.fullmatch(match["content"].rstrip())
    if is_error:
        unread = Unread.ERROR_FRAMES
    elif match["raw_dlc"]:
        unread = Unread.LONG_DLC_FRAMES
    elif len(length) > 1:  # two digits for CAN FD, four for CAN XL
        unread = Unread.CAN_FD_FRAMES if len(length) == 2 else Unread.CAN_XL_FRAMES
    elif match["content"].strip() == "remote request":
        unread = Unread.REMOTE_FRAMES
    elif shown is None:
        raise UnreadableError("its data are not hexadecimal bytes in their order")
    else:
        data = hex_bytes(shown["data"].split(), int(length))
    received = match["direction"] not in ("T", "t")
    time_s = _time_s(match["time"])
    return Entry(time_s, match["channel"], frame_id, data, is_extended, received, unread)


def _identifier(text: str) -> tuple[int, bool, bool]:
    """Identifier, whether it is extended, whether it marks an error frame."""
    frame_id = int(text, 16)
    if len(text) == _STANDARD_DIGITS:
        return frame_id, False, False
    if frame_id > _HIGHEST_FLAGGED_ID:
        raise UnreadableError(f"no CAN frame has the identifier {text}")
    return frame_id, True, bool(frame_id & _ERROR_FLAG)


def _time_s(text: str | None) -> float:
    if text is None:
        raise UnreadableError("there are no times in it", "record it with 'candump -L'")
    if "-" in text[1:] and ":" in text:  # candump -t A
        try:
            local = datetime.fromisoformat(text.strip())
        except ValueError:
            raise UnreadableError(f"'{text[:40]}' is not a time") from None
        return local.replace(tzinfo=timezone.utc).timestamp()
    return seconds(text)
