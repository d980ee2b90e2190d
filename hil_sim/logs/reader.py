"""Reading of logs: every frame is read, or counted among what is not, or the log is refused.

Each format has a reader of its own in this package, which gives the entries of a file; here they
become frames in the order of time, of one channel.
"""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, islice
from pathlib import Path

from bms.errors import InputError
from hil_sim.bus.limits import HIGHEST_EXTENDED_ID, HIGHEST_STANDARD_ID, MAX_DATA_LENGTH
from hil_sim.logs.candump import CandumpParser
from hil_sim.logs.csv_rows import CsvParser
from hil_sim.logs.formats import LogFormat, usable_format
from hil_sim.logs.frame import CutOffError, Entry, LogFrame, Unread, UnreadableError
from hil_sim.logs.mdf4 import mdf4_entries
from hil_sim.logs.peak_trc import TrcParser
from hil_sim.logs.sniffing import what_it_looks_like
from hil_sim.logs.text import LineParser, text_entries
from hil_sim.logs.vector_asc import AscParser
from hil_sim.logs.vector_blf import blf_entries

_PARSERS: Mapping[str, type[LineParser]] = {
    ".log": CandumpParser,
    ".asc": AscParser,
    ".csv": CsvParser,
    ".trc": TrcParser,
}
_READERS = {".blf": blf_entries, ".mf4": mdf4_entries}
MOST_ENTRIES = 2_000_000
"""Five hours of a charge; a compressed log of few bytes can hold many times more."""

_HIGHEST_TIME_S = 1e11
_MICROSECONDS = 6

_Located = Sequence[tuple[int, Entry]]


@dataclass(frozen=True)
class Selection:
    """What of a log is read, and how: one of its channels, and times that count from the entry
    before instead of from a common start."""

    channel: str | None = None
    delta_times: bool = False


ALL = Selection()


@dataclass(frozen=True)
class Log:
    """The data frames of a log in the order of time, and how many of what was not read."""

    frames: tuple[LogFrame, ...]
    unread: Mapping[Unread, int]
    places: tuple[int, ...]
    """The line of each frame, or its number among the entries of a binary file."""

    def __iter__(self) -> Iterator[LogFrame]:
        return iter(self.frames)


def read_log(path: Path, selection: Selection = ALL) -> Log:
    """The classical data frames of a log.

    Raises InputError in one line for a log that is missing, damaged, cut off, empty, not in the
    order of time, or of several channels of which none is selected.
    """
    form = usable_format(path)
    try:
        located, are_relative = _entries(path, form)
    except UnreadableError as error:
        raise _refusal(path, form, error) from None
    except OSError as error:
        raise _unopened(path, error) from None
    if are_relative or selection.delta_times:
        located = _added_up(located)
    unread = Counter[Unread]()
    for _, entry in located:
        if entry.unread is not None and entry.number:
            unread[entry.unread] += entry.number
    data = [(place, entry) for place, entry in located if entry.unread is None]
    kept = _of_one_channel(path, data, selection.channel)
    if len(kept) < len(data):
        unread[Unread.OTHER_CHANNEL_FRAMES] = len(data) - len(kept)
    if not kept:
        counts = f" (not read: {described(unread)})" if unread else ""
        remedy = what_it_looks_like(path, form) or "record it again"
        raise InputError(f"{path}: empty, there is no data frame in it{counts}; {remedy}")
    frames = tuple(_in_order(path, form, kept))
    return Log(frames, unread, tuple(place for place, _ in kept))


def described(unread: Mapping[Unread, int]) -> str:
    """Counts of what was not read, for a reader."""
    return ", ".join(kind.text(unread[kind]) for kind in Unread if unread.get(kind))


def _entries(path: Path, form: LogFormat) -> tuple[_Located, bool]:
    """The entries and their places, and whether the file says that its times are relative."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: not a file; give the path of a log")
    if form.suffix in _PARSERS:
        parser = _PARSERS[form.suffix]()
        return _limited(path, text_entries(path, parser)), parser.delta_times
    return _limited(path, _READERS[form.suffix](path)), False


def _limited(path: Path, entries: Iterable[tuple[int, Entry]]) -> _Located:
    located = list(islice(entries, MOST_ENTRIES + 1))
    if len(located) > MOST_ENTRIES:
        raise InputError(
            f"{path}: more than {MOST_ENTRIES} entries are in it; split it, and read the parts"
        )
    return located


def _added_up(located: _Located) -> _Located:
    """Entries whose times count from the entry before, with times from the first one."""
    times_s = accumulate(entry.time_s or 0.0 for _, entry in located)
    return [
        (place, entry if entry.time_s is None else entry._replace(time_s=time_s))
        for (place, entry), time_s in zip(located, times_s)
    ]


def _of_one_channel(path: Path, data: _Located, channel: str | None) -> _Located:
    counts = Counter(entry.channel for _, entry in data)
    if channel is None and len(counts) < 2:
        return data
    names = _printable(", ".join(f"{name} ({counts[name]} frames)" for name in sorted(counts)))
    if channel is None:
        first = min(counts, key=lambda name: (-counts[name], name))
        raise InputError(
            f"{path}: frames of {len(counts)} channels are in it, {names}; "
            f"choose one, as with --channel {shlex.quote(_printable(first))}"
        )
    if channel not in counts:
        raise InputError(
            f"{path}: no frame of channel '{channel}' is in it; "
            f"leave --channel out or give one of {names or 'none'}"
        )
    return [(place, entry) for place, entry in data if entry.channel == channel]


def _in_order(path: Path, form: LogFormat, data: _Located) -> Iterator[LogFrame]:
    last_s = -math.inf
    for number, (place, entry) in enumerate(data, start=1):
        frame = _frame(entry)
        if frame is None or frame.time_s < last_s:
            where = f"line {place}, frame {number}" if form.is_text else f"frame {number}"
            if frame is None:
                raise InputError(
                    f"{path}: {where}: no CAN frame has such a time, identifier or length; "
                    "the file is damaged, record it again"
                )
            hint = "give --delta-times if each time counts from the line before, else "
            raise InputError(
                f"{path}: {where}: time goes back from {last_s:.6f} s to {frame.time_s:.6f} s; "
                f"{hint if form.is_text else ''}the log was reordered, record it again"
            )
        last_s = frame.time_s
        yield frame


def _frame(entry: Entry) -> LogFrame | None:
    """None for what no bus carries."""
    time_s, _, frame_id, data, is_extended, received, *_ = entry
    highest_id = HIGHEST_EXTENDED_ID if is_extended else HIGHEST_STANDARD_ID
    if time_s is None or not abs(time_s) <= _HIGHEST_TIME_S:
        return None
    if not 0 <= frame_id <= highest_id or len(data) > MAX_DATA_LENGTH:
        return None
    time_s = round(time_s, _MICROSECONDS) + 0.0  # no negative zero
    return LogFrame(time_s, frame_id, data, is_extended, received)


def _printable(text: str) -> str:
    """What a log says may hold anything, also what a terminal would obey."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _refusal(path: Path, form: LogFormat, error: UnreadableError) -> InputError:
    where = f"{error.where}: " if error.where else ""
    reason = _printable(str(error))
    other = what_it_looks_like(path, form)
    if isinstance(error, CutOffError) and not other:
        said = reason if "cut off" in reason else f"cut off ({reason})"
        return InputError(f"{path}: {where}{said}; {error.remedy or 'record it again'}")
    remedy = other or error.remedy or "it is damaged, record it again"
    return InputError(f"{path}: {where}cannot be read as '{form.suffix}' ({reason}); {remedy}")


def _unopened(path: Path, error: OSError) -> InputError:
    if isinstance(error, FileNotFoundError):
        return InputError(f"{path}: no such file; give the path of a log")
    reason = error.strerror or str(error)
    return InputError(f"{path}: cannot be opened ({reason}); give a file that can be read")
