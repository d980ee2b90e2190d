"""The process in which asammdf reads logs; see hil_sim.logs.mdf4.

    python -m hil_sim.logs.mdf4_worker LOG...

Prints a line of JSON for each log: its entries, or why it cannot be read.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hil_sim.bus.limits import MAX_DATA_LENGTH
from hil_sim.logs.frame import Entry, Unread, UnreadableError
from hil_sim.logs.numbers import LONG_DLCS

try:
    import resource
except ImportError:  # Windows: without the limits
    resource = None  # type: ignore[assignment]

_LEAST_TIME_S, _TIME_S_PER_BYTE = 1.0, 1e-4
"""Limit of processor time; a log of 100 kB, which compresses 70,000 frames, takes 1 s."""
_MEMORY_BYTES = 4 << 30

_BUS_EVENT, _VARIABLE_LENGTH, _BUS, _CAN = 2, 1, 2, 2
_GROUP_MARK = b"##CG"
_GROUP = struct.Struct("<4s4xQQ48xQQH")
_MASTERS = {
    "CAN_DataFrame": None,
    "CAN_ErrorFrame": Unread.ERROR_FRAMES,
    "CAN_RemoteFrame": Unread.REMOTE_FRAMES,
}
_ID_MASK, _EXTENDED_FLAG = 0x1FFFFFFF, 0x80000000


def read(path: Path) -> list[Entry]:
    """All entries of a log in the order of time; UnreadableError and what asammdf raises."""
    from asammdf import MDF  # noqa: PLC0415 -- takes a second, and not everybody has it

    with _Complaints() as complaints, MDF(path) as mdf:
        counts = [int(group.channel_group.cycles_nr) for group in mdf.groups]
        announced = _announced(path.read_bytes())
        if sum(counts) != announced:
            raise UnreadableError(f"damaged: of {announced} records {sum(counts)} can be found")
        entries = [entry for index in range(len(counts)) for entry in _group(mdf, index)]
    if complaints.number:
        raise UnreadableError("asammdf finds errors in it")
    return sorted(entries, key=lambda entry: entry.time_s or 0.0)


def _announced(data: bytes) -> int:
    """Records that the file's channel groups say they have, wherever the groups lie."""
    total, position = 0, data.find(_GROUP_MARK)
    while position >= 0:
        if position % 8 == 0 and position + _GROUP.size <= len(data):
            *_, cycles, flags = _GROUP.unpack_from(data, position)
            total += 0 if flags & _VARIABLE_LENGTH else cycles
        position = data.find(_GROUP_MARK, position + 1)
    return total


def _group(mdf: Any, index: int) -> Iterator[Entry]:
    group = mdf.groups[index]
    count = int(group.channel_group.cycles_nr)
    source = group.channel_group.acq_source
    names = {channel.name for channel in group.channels}
    master = next((name for name in _MASTERS if name in names), None)
    is_can = (
        group.channel_group.flags & _BUS_EVENT
        and source is not None
        and source.source_type == _BUS
        and source.bus_type == _CAN
    )
    if not count:
        return
    if not is_can or master is None:
        yield Entry(None, unread=Unread.OTHER_ENTRIES, number=count)
    elif (unread := _MASTERS[master]) is not None:
        yield Entry(None, unread=unread, number=count)
    else:
        yield from _data_frames(mdf, index, master, count)


def _data_frames(mdf: Any, index: int, master: str, count: int) -> Iterator[Entry]:
    signal_ = mdf.get(master, group=index, raw=False)
    start_s = mdf.header.start_time.timestamp()
    samples = signal_.samples
    if len(samples) != count or len(signal_.timestamps) != count:
        raise UnreadableError(f"damaged: of {count} frames {len(samples)} can be read")
    columns = {name.removeprefix(f"{master}."): samples[name] for name in samples.dtype.names}

    def column(name: str, default: int) -> list[Any]:
        return list(columns[name].tolist()) if name in columns else [default] * count

    lengths = column("DataLength", 0)
    rows = zip(
        signal_.timestamps.tolist(),
        column("BusChannel", 0),
        column("ID", 0),
        column("IDE", -1),
        column("Dir", 0),
        column("EDL", 0),
        column("DLC", 0),
        lengths,
        columns["DataBytes"],
        strict=True,
    )
    for time, channel, raw_id, ide, direction, edl, dlc, length, data in rows:
        yield Entry(
            float(time) + start_s,
            str(channel),
            int(raw_id) & _ID_MASK,
            _content(data, length),
            bool(int(raw_id) & _EXTENDED_FLAG) if ide < 0 else bool(ide),
            direction in (0, b"Rx"),
            _unread(edl, dlc, length),
        )


def _content(data: Any, length: int) -> bytes:
    if length > len(data):
        raise UnreadableError(f"{length} bytes are announced, {len(data)} are there")
    return bytes(data[:length])


def _unread(edl: int, dlc: int, length: int) -> Unread | None:
    if edl or length > MAX_DATA_LENGTH:
        return Unread.CAN_FD_FRAMES
    return Unread.LONG_DLC_FRAMES if dlc in LONG_DLCS else None


class _Complaints(logging.Handler):
    """What asammdf logs about a file, which it would print instead."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.number = 0
        self._logger = logging.getLogger("asammdf")

    def emit(self, record: logging.LogRecord) -> None:
        """Count one."""
        self.number += 1

    def __enter__(self) -> _Complaints:
        self._others, self._logger.handlers = self._logger.handlers, [self]
        return self

    def __exit__(self, *error: object) -> None:
        self._logger.handlers = self._others


def _answer(path: Path) -> dict[str, Any]:
    try:
        entries = read(path)
    except Exception as error:  # asammdf is not made for damaged files and raises anything
        if isinstance(error, UnreadableError):
            return {"error": str(error)}
        return {"error": f"asammdf breaks down in it with {type(error).__name__}"}
    return {"entries": [_row(entry) for entry in entries]}


def _row(entry: Entry) -> tuple[Any, ...]:
    unread = entry.unread.name if entry.unread else None
    return (*entry[:3], entry.data.hex(), *entry[4:6], unread, entry.number)


def _limit(path: Path) -> None:
    """End the process by a signal if it takes too long from here on."""
    if hasattr(signal, "setitimer"):
        allowed_s = _LEAST_TIME_S + _TIME_S_PER_BYTE * path.stat().st_size
        signal.setitimer(signal.ITIMER_PROF, allowed_s)


def main() -> None:
    """Read each log of the command line within the limits."""
    import asammdf  # noqa: F401, PLC0415 -- before the clock runs

    if resource is not None:
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="ascii")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # asammdf prints there
    for name in sys.argv[1:]:
        _limit(Path(name))
        print(json.dumps(_answer(Path(name))), file=answers, flush=True)


if __name__ == "__main__":
    main()
