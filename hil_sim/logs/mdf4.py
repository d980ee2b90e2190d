"""ASAM MDF 4, read by asammdf in a process of its own.

asammdf reads what no small grammar could. But on a damaged file it may run without end, crash the
process, report the fault on stderr and go on without the group, or use all memory. So it gets a
process with limits, and what it gives is held against the counts in the file.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from hil_sim.logs.frame import CutOffError, Entry, Unread, UnreadableError

_MARK = b"MDF "
_NOT_FINISHED_MARK = b"UnFinMF "


def mdf4_entries(path: Path) -> Iterator[tuple[int, Entry]]:
    """The number of each entry, and the entry.

    Raises UnreadableError, CutOffError for a file that its recorder did not close, and OSError.
    """
    with path.open("rb") as file:
        mark = file.read(len(_NOT_FINISHED_MARK))
    if mark == _NOT_FINISHED_MARK:
        raise CutOffError("its recorder did not close it (it is not finalised)")
    if not mark.startswith(_MARK):
        raise UnreadableError("it begins otherwise")
    command = [sys.executable, "-m", "hil_sim.logs.mdf4_worker", str(path)]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode:
        ends = done.returncode == -getattr(signal, "SIGPROF", 0)
        raise UnreadableError(f"asammdf {'finds no end' if ends else 'breaks down'} in it")
    yield from decoded(done.stdout)


def decoded(line: bytes) -> Iterator[tuple[int, Entry]]:
    """What one line of the worker's output says."""
    answer = json.loads(line)
    if "error" in answer:
        raise UnreadableError(answer["error"])
    for number, row in enumerate(answer["entries"], start=1):
        time_s, channel, frame_id, data, is_extended, received, unread, how_many = row
        kind = None if unread is None else Unread[unread]
        content = bytes.fromhex(data)
        entry = Entry(time_s, channel, frame_id, content, is_extended, received, kind, how_many)
        yield number, entry
