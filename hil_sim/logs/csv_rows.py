"""Logs of comma-separated values: python-can's, and SavvyCAN's (its native one, also of GVRET).

python-can's reader drops the first line without looking at it and knows no other separator;
SavvyCAN's it does not know. Which of the two it is, the header tells, or else the first row.
Source: python-can, CSVWriter; SavvyCAN, FrameFileIO::saveNativeCSVFile.
"""

from __future__ import annotations

import csv
import re
from base64 import b64decode
from collections.abc import Callable, Sequence

from hil_sim.bus.limits import HIGHEST_STANDARD_ID, MAX_DATA_LENGTH
from hil_sim.logs.frame import Entry, Unread, UnreadableError
from hil_sim.logs.numbers import LONG_DLCS, seconds, whole

PYTHON_CAN = "timestamp,arbitration_id,extended,remote,error,dlc,data"
SAVVYCAN = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"
_WANTED = (
    f"the columns have to be python-can's ({PYTHON_CAN}) or SavvyCAN's ({SAVVYCAN}, Dir optional)"
)
_SEPARATORS = ",;\t"
_TRUTH = {"1": True, "true": True, "0": False, "false": False}
_WHOLE_TIME = re.compile(r"-?\d{1,19}", re.ASCII)
_MICROSECONDS = 1e6


class CsvParser:
    """Rows of one file."""

    delta_times = False

    def __init__(self) -> None:
        self._separator = ""
        self._row: Callable[[list[str]], Entry] | None = None
        self._has_direction = True

    def parse(self, line: str) -> Entry | None:
        """The row's entry; UnreadableError for a row that is damaged."""
        text = line.strip()
        if text.lower().startswith("sep=") and not self._separator:
            self._separator = text[4:5]
            return None
        self._separator = self._separator or max(_SEPARATORS, key=text.count)
        fields = self._split(line)
        if self._row is None:
            self._row, is_header = self._recognised(fields)
            if is_header:
                return None
        return self._row(fields)

    def _split(self, line: str) -> list[str]:
        try:
            (fields,) = csv.reader([line.strip("\r\n ")], delimiter=self._separator or ",")
        except (csv.Error, TypeError, ValueError) as error:
            raise UnreadableError(f"not a row of values ({error})") from None
        return [field.strip() for field in fields]

    def _recognised(self, fields: list[str]) -> tuple[Callable[[list[str]], Entry], bool]:
        names = [field.lower() for field in fields]
        if names == PYTHON_CAN.split(","):
            return self._python_can, True
        savvy = SAVVYCAN.lower().split(",")
        for has_direction in (True, False):
            columns = savvy if has_direction else [name for name in savvy if name != "dir"]
            length = columns.index("d1")
            is_data = all(name[:1] in ("", "d") for name in names[length:])
            if names[:length] == columns[:length] and is_data:
                self._has_direction = has_direction
                return self._savvycan, True
        if len(fields) == len(PYTHON_CAN.split(",")) and fields[2] in ("0", "1"):
            return self._python_can, False
        if len(fields) > 4 and fields[2].lower() in ("true", "false"):
            self._has_direction = fields[3].lower() in ("rx", "tx")
            return self._savvycan, False
        raise UnreadableError("neither a header nor a row of a log", _WANTED)

    def _python_can(self, fields: list[str]) -> Entry:
        if len(fields) != len(PYTHON_CAN.split(",")):
            raise UnreadableError(f"{len(fields)} values, {PYTHON_CAN.count(',') + 1} are wanted")
        time, frame_id, extended, remote, error, dlc, data = fields
        if self._separator == ";":
            time = time.replace(",", ".")
        base = Entry(seconds(time), "", _identifier(frame_id), is_extended=_truth(extended))
        if _truth(error):
            return base._replace(unread=Unread.ERROR_FRAMES)
        if _truth(remote):
            return base._replace(unread=Unread.REMOTE_FRAMES)
        try:
            content = b64decode(data, validate=True)
        except ValueError:
            raise UnreadableError("its data are not in base64") from None
        return _with_data(base, whole(dlc), content)

    def _savvycan(self, fields: list[str]) -> Entry:
        if not self._has_direction:
            fields = [*fields[:3], "Rx", *fields[3:]]
        if len(fields) < 6:
            raise UnreadableError(f"{len(fields)} values are too few")
        time, frame_id, extended, direction, bus, length, *data = fields
        if not _WHOLE_TIME.fullmatch(time):
            raise UnreadableError(
                f"'{time[:40]}' is not a time",
                "write times as whole microseconds, as SavvyCAN does",
            )
        if direction.lower() not in ("rx", "tx"):
            raise UnreadableError(f"'{direction[:40]}' is neither Rx nor Tx")
        number = _identifier(frame_id)
        base = Entry(
            round(int(time) / _MICROSECONDS, 6),
            bus,
            number,
            # Some versions leave the mark of an extended identifier out.
            is_extended=_truth(extended) or number > HIGHEST_STANDARD_ID,
            received=direction.lower() == "rx",
        )
        count = whole(length)
        return _with_data(base, count, _bytes(data, count))


def _with_data(base: Entry, length: int, data: bytes) -> Entry:
    """A length above 8 is CAN FD, unless just 8 bytes are there."""
    if length in LONG_DLCS and len(data) == MAX_DATA_LENGTH:
        return base._replace(unread=Unread.LONG_DLC_FRAMES)
    if len(data) != length:
        raise UnreadableError(f"{length} bytes are announced, {len(data)} are there")
    return base._replace(
        data=data, unread=Unread.CAN_FD_FRAMES if length > MAX_DATA_LENGTH else None
    )


def _bytes(fields: Sequence[str], length: int) -> bytes:
    """Of SavvyCAN's columns; the empty ones at the end count for nothing."""
    count = len(fields)
    while count and not fields[count - 1]:
        count -= 1
    used = fields[:count]
    if count > length:  # firmware of loggers fills up with zeros
        if any(field.strip("0") for field in used[length:]):
            raise UnreadableError(f"{length} bytes are announced, {count} are there")
        used = used[:length]
    digits = [field.lower().removeprefix("0x") for field in used]
    if any(len(digit) > 2 for digit in digits):
        raise UnreadableError("a byte has more than two digits")
    return bytes(whole(digit, 16) for digit in digits)


def _identifier(text: str) -> int:
    return whole(text.lower().removeprefix("0x"), 16)


def _truth(text: str) -> bool:
    if text.lower() not in _TRUTH:
        raise UnreadableError(f"'{text[:40]}' is neither true nor false")
    return _TRUTH[text.lower()]
