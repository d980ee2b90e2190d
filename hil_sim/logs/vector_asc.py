"""Vector's text format ASC, which BUSMASTER, SavvyCAN, log2asc and python-can write too.

python-can's reader takes the first line that it does not know for the end of the header and drops
it, passes over lines with negative times, takes every CANFD line for CAN FD and reads relative
times as absolute ones; hence this grammar. Source: the files that these tools write, and
can-utils, log2asc.c, for the flags of CANFD and CANXL lines.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from hil_sim.bus.limits import HIGHEST_STANDARD_ID, MAX_DATA_LENGTH
from hil_sim.logs.frame import Entry, Unread, UnreadableError
from hil_sim.logs.numbers import LONG_DLCS, seconds, whole

_TIME = re.compile(r"[-+]?\d+\.\d+", re.ASCII)
_BASE = re.compile(r"base\s+(?P<base>hex|dec)", re.IGNORECASE)
_TIMES = re.compile(r"timestamps\s+(?P<times>absolute|relative)", re.IGNORECASE)
_NO_EVENT = re.compile(
    r"date\s|base\s|//|(no\s+)?internal\s+events?\s|(begin|end)\s+triggerblock|previous\s+log\s+file"
    r"|split\s",
    re.IGNORECASE,
)
_DIRECTIONS = ("rx", "tx", "txrq")
_BYTE = {
    16: re.compile(r"[0-9A-F]{1,2}", re.ASCII | re.IGNORECASE),
    10: re.compile(r"\d{1,3}", re.ASCII),
}
_DLC = re.compile(r"[0-9A-F]", re.ASCII | re.IGNORECASE)
_RTR, _FDF = 0x10, 0x1000
_XL_TYPES = {
    "XLFF": Unread.CAN_XL_FRAMES,
    "FBFF": Unread.CAN_FD_FRAMES,
    "FEFF": Unread.CAN_FD_FRAMES,
    "CBFF": None,
    "CEFF": None,
}


class AscParser:
    """Lines of one file, whose header may be missing: numbers are hexadecimal, times absolute."""

    def __init__(self) -> None:
        self.delta_times = False
        self._base = 16
        self._is_header = True

    def parse(self, line: str) -> Entry | None:
        """The line's entry; UnreadableError for a line that is damaged."""
        words = line.split()
        if not _TIME.fullmatch(words[0]):
            return self._without_time(line.strip())
        self._is_header = False
        time_s = seconds(words[0])
        if len(words) == 1:
            raise UnreadableError("nothing follows the time")
        entry = self._entry(words[1:])
        if entry is None:  # where times are relative, the next line counts from this one
            entry = Entry(None, unread=Unread.OTHER_ENTRIES, number=0)
        return entry._replace(time_s=time_s)

    def _without_time(self, text: str) -> Entry | None:
        if _NO_EVENT.match(text):
            if match := _BASE.match(text):
                self._base = 10 if match["base"].lower() == "dec" else 16
            if match := _TIMES.search(text):
                self.delta_times = match["times"].lower() == "relative"
            return None
        directions = [word for word in text.split()[:5] if word.lower() in _DIRECTIONS]
        if self._is_header and not directions:
            return Entry(None, unread=Unread.OTHER_ENTRIES)
        raise UnreadableError("it has no time")

    def _entry(self, words: Sequence[str]) -> Entry | None:
        kind = words[0].upper()
        if kind.isdigit():
            return self._classical(words[1:])._replace(channel=words[0])
        if kind in ("CANFD", "CANXL"):
            if len(words) < 4:
                raise UnreadableError(f"a {kind} line has more columns")
            read = self._fd if kind == "CANFD" else self._xl
            return read(words[3:])._replace(channel=words[1], received=_is_received(words[2]))
        if kind in ("START", "END") and words[1:2] == ["of"]:  # measurement
            return None
        return Entry(None, unread=Unread.OTHER_ENTRIES)

    def _classical(self, words: Sequence[str]) -> Entry:
        """Identifier, direction, d or r, DLC, data."""
        first = words[0].lower() if words else ""
        if first.startswith("errorframe"):
            return Entry(None, unread=Unread.ERROR_FRAMES)
        if not any(word.lower() in _DIRECTIONS for word in words[:4]) or first == "j1939tp":
            if not words:
                raise UnreadableError("nothing follows the channel")
            return Entry(None, unread=Unread.OTHER_ENTRIES)  # statistics and other events
        if len(words) < 3 or words[1].lower() not in _DIRECTIONS:
            raise UnreadableError("neither a frame nor an event")
        base = self._identified(words[0])._replace(received=_is_received(words[1]))
        form = words[2].lower()
        if form == "r":
            return base._replace(unread=Unread.REMOTE_FRAMES)
        if form != "d" or len(words) < 4:
            raise UnreadableError("a frame goes on with 'd', its DLC and data")
        entry = self._with_data(base, whole(words[3], self._base), words[4:])
        if words[1].lower() == "txrq" and entry.unread is None:
            return entry._replace(unread=Unread.TRANSMIT_REQUESTS)
        return entry

    def _fd(self, words: Sequence[str]) -> Entry:
        """Identifier, perhaps a name, BRS, ESI, DLC, length, data, duration, bits, flags."""
        if any(word.lower().startswith("errorframe") for word in words[:2]):
            return Entry(None, unread=Unread.ERROR_FRAMES)
        base = self._identified(words[0])
        start = 1 if len(words) > 1 and words[1] in ("0", "1") else 2
        if len(words) < start + 4:
            raise UnreadableError("a CANFD line has more columns")
        dlc, length = whole(words[start + 2], 16), whole(words[start + 3])
        after = start + 4 + length
        if len(words) < after + 3:
            raise UnreadableError("a CANFD line has more columns")
        flags = whole(words[after + 2], 16)
        if flags & _FDF:
            return base._replace(unread=Unread.CAN_FD_FRAMES)
        return self._classical_in_fd(base, dlc, length, flags, words[start + 4 : after])

    def _xl(self, words: Sequence[str]) -> Entry:
        """Type, duration, bits, identifier, perhaps a name, DLC, length, data, checksum, flags."""
        if words[0].upper() not in _XL_TYPES:
            raise UnreadableError(f"'{words[0][:40]}' is no type of a CANXL line")
        unread = _XL_TYPES[words[0].upper()]
        if unread is not None:
            return Entry(None, unread=unread)
        if len(words) < 4:
            raise UnreadableError("a CANXL line has more columns")
        base = self._identified(words[3])
        start = 4 if len(words) > 5 and _DLC.fullmatch(words[4]) and words[5].isdigit() else 5
        if len(words) < start + 2:
            raise UnreadableError("a CANXL line has more columns")
        dlc, length = whole(words[start], 16), whole(words[start + 1])
        after = start + 2 + length
        if len(words) < after + 2:
            raise UnreadableError("a CANXL line has more columns")
        flags = whole(words[after + 1], 16)
        return self._classical_in_fd(base, dlc, length, flags, words[start + 2 : after])

    def _classical_in_fd(
        self, base: Entry, dlc: int, length: int, flags: int, words: Sequence[str]
    ) -> Entry:
        if flags & _RTR or (length == 0 and dlc > 0):
            return base._replace(unread=Unread.REMOTE_FRAMES)
        if length != min(dlc, MAX_DATA_LENGTH):
            raise UnreadableError(f"a classical frame of DLC {dlc} has no {length} bytes")
        return self._with_data(base, dlc, words)

    def _with_data(self, base: Entry, dlc: int, words: Sequence[str]) -> Entry:
        if dlc > max(LONG_DLCS):
            raise UnreadableError(f"no CAN frame has DLC {dlc}")
        length = min(dlc, MAX_DATA_LENGTH)
        data = words[:length]
        if len(data) < length:
            raise UnreadableError(f"{length} bytes are announced, {len(data)} are there")
        if not all(map(_BYTE[self._base].fullmatch, data)):
            kind = "hexadecimal" if self._base == 16 else "decimal"
            raise UnreadableError(f"its data are not {kind} bytes")
        values = [int(word, self._base) for word in data]
        if max(values, default=0) > 0xFF:
            raise UnreadableError("a byte is greater than 255")
        return base._replace(
            data=bytes(values), unread=Unread.LONG_DLC_FRAMES if dlc in LONG_DLCS else None
        )

    def _identified(self, text: str) -> Entry:
        digits = text[:-1] if text[-1:] in "xX" else text
        try:
            frame_id = whole(digits, self._base)
        except UnreadableError:
            raise UnreadableError(
                f"'{text[:40]}' is not an identifier",
                "save it again with identifiers as numbers, not as names",
            ) from None
        # Some tools leave the x of an extended identifier out.
        is_extended = len(digits) < len(text) or frame_id > HIGHEST_STANDARD_ID
        return Entry(None, frame_id=frame_id, is_extended=is_extended)


def _is_received(direction: str) -> bool:
    if direction.lower() not in _DIRECTIONS:
        raise UnreadableError(f"'{direction[:40]}' is neither Rx nor Tx")
    return direction.lower() == "rx"
