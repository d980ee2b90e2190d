"""PEAK's text format TRC, versions 1.0 to 2.1.

python-can's reader drops a line that lacks columns without a word and reads version 1.2 as 1.0;
hence this grammar. Times count from the start of the recording, whose date is left out: it does
not keep microseconds. Source: PEAK-System, PEAK CAN TRC File Format.
"""

from __future__ import annotations

import re

from hil_sim.bus.limits import MAX_DATA_LENGTH
from hil_sim.logs.frame import Entry, Unread, UnreadableError
from hil_sim.logs.numbers import LONG_DLCS, hex_bytes, seconds, whole

_COLUMNS = {
    "1.0": "N,O,I,L,D",
    "1.1": "N,O,d,I,L,D",
    "1.2": "N,O,B,d,I,L,D",
    "1.3": "N,O,B,d,I,R,L,D",
    "2.0": "N,O,T,I,d,l,D",
    "2.1": "N,O,T,B,I,d,R,l,D",
}
"""Number, time, type, bus, identifier, direction, reserved, length (l) or DLC (L), data."""
_TYPES = {
    "DT": None,
    "RR": Unread.REMOTE_FRAMES,
    **dict.fromkeys(("FD", "FB", "FE", "BI"), Unread.CAN_FD_FRAMES),
    "ER": Unread.ERROR_FRAMES,
    **dict.fromkeys(("ST", "EC", "EV"), Unread.OTHER_ENTRIES),
}
_DIRECTIONS_1 = {
    "rx": None,
    "tx": None,
    "error": Unread.ERROR_FRAMES,
    "warng": Unread.OTHER_ENTRIES,
}
_BUS_WARNING_ID = "FFFFFFFF"
_HEADER = re.compile(r";\$(?P<key>FILEVERSION|COLUMNS)\s*=\s*(?P<value>\S+)", re.IGNORECASE)
_NUMBER = re.compile(r"\d+\)?", re.ASCII)
_MICROSECONDS = 6


class TrcParser:
    """Lines of one file; without a header it is version 1.0, as the format says."""

    delta_times = False

    def __init__(self) -> None:
        self._columns = _COLUMNS["1.0"].split(",")

    def parse(self, line: str) -> Entry | None:
        """The line's entry; UnreadableError for a line that is damaged."""
        text = line.strip()
        if text.startswith(";"):
            if match := _HEADER.match(text):
                self._follow_header(match["key"].upper(), match["value"])
            return None
        words = text.split(maxsplit=len(self._columns) - 1)
        at = dict(zip(self._columns, words))
        if not _NUMBER.fullmatch(at["N"]):
            raise UnreadableError("it does not begin with the number of a message")
        if "O" not in at:
            raise UnreadableError("it has no time")
        time_s = round(seconds(at["O"]) / 1000.0, _MICROSECONDS)
        return self._entry(at)._replace(time_s=time_s)

    def _follow_header(self, key: str, value: str) -> None:
        if key == "COLUMNS":
            self._columns = value.split(",")
            if self._columns[:2] != ["N", "O"] or not {"I", "D"} <= set(self._columns):
                raise UnreadableError(f"columns {value[:40]} are none of a CAN trace")
        elif value in _COLUMNS:
            self._columns = _COLUMNS[value].split(",")
        else:
            raise UnreadableError(
                f"version {value[:40]} of the format is not known",
                f"save it again as one of {', '.join(_COLUMNS)}",
            )

    def _entry(self, at: dict[str, str]) -> Entry:
        channel = at.get("B", "")
        kind = self._kind(at)
        if kind is not None:
            return Entry(None, channel, unread=kind)
        if "I" not in at or not {"l", "L"} & set(at):
            raise UnreadableError("it has fewer columns than the header says")
        base = Entry(
            None,
            channel,
            whole(at["I"], 16),
            is_extended=len(at["I"]) > 4,
            received=at.get("d", "Rx").lower() == "rx",
        )
        length, words = whole(at.get("l") or at["L"]), at.get("D", "").split()
        if words[:1] == ["RTR"]:
            return base._replace(unread=Unread.REMOTE_FRAMES)
        if words[:1] == ["ERROR"]:
            return base._replace(unread=Unread.ERROR_FRAMES)
        is_long = length in LONG_DLCS
        data = hex_bytes(words, MAX_DATA_LENGTH if is_long else length)
        return base._replace(data=data, unread=Unread.LONG_DLC_FRAMES if is_long else None)

    def _kind(self, at: dict[str, str]) -> Unread | None:
        if "T" in self._columns:
            if at.get("T") not in _TYPES:
                raise UnreadableError(f"'{at.get('T', '')[:40]}' is no type of message")
            kind = _TYPES[at["T"]]
            if kind is None and at.get("d") not in ("Rx", "Tx"):
                raise UnreadableError("its direction is neither Rx nor Tx")
            return kind
        if "d" in self._columns:
            if at.get("d", "").lower() not in _DIRECTIONS_1:
                raise UnreadableError(f"'{at.get('d', '')[:40]}' is no type of message")
            return _DIRECTIONS_1[at["d"].lower()]
        return Unread.OTHER_ENTRIES if at.get("I", "").upper() == _BUS_WARNING_ID else None
