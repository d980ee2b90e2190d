"""Writing of logs with python-can's writers."""

from __future__ import annotations

import gzip
import importlib
import sys
from collections.abc import Iterable
from contextlib import ExitStack
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import can
from can.io.logger import MESSAGE_WRITERS

from hil_sim.bus.closing import Closing
from hil_sim.bus.limits import HIGHEST_STANDARD_ID
from hil_sim.logs.formats import is_compressed, usable_format
from hil_sim.logs.frame import LogFrame

CHANNEL = "vcan0"
"""Name in a candump log whatever the bus was, so that equal runs give equal logs and canplayer
plays."""


class _CandumpLines:
    """What python-can's writer makes of data frames, without a message for each line.

    A frame that is older than the first one gets the time of that.
    """

    def __init__(self, file: Any) -> None:
        self._write = file.write
        self._first_s: float | None = None
        self._time_s: float | None = None
        self._begin = ""

    def write(
        self,
        time_s: float,
        frames: Iterable[tuple[int, bytes]],
        received: bool,
        is_extended: bool = False,
    ) -> None:
        if time_s != self._time_s:
            self._time_s = time_s
            self._begin = self._begin_of(round(time_s, 6))
        begin, end = self._begin, _ENDS[received]
        if is_extended:
            lines = [f"{begin}{i:08X}#{data.hex().upper()}{end}" for i, data in frames]
        else:
            lines = [f"{begin}{_SHOWN[i]}{data.hex().upper()}{end}" for i, data in frames]
        self._write("".join(lines))

    def _begin_of(self, time_s: float) -> str:
        if self._first_s is None:
            self._first_s = time_s or 0.0
        return f"({max(time_s, self._first_s):f}) {CHANNEL} "


_ENDS = {True: " R\n", False: " T\n"}
_SHOWN = [f"{frame_id:03X}#" for frame_id in range(HIGHEST_STANDARD_ID + 1)]


class LogWriter(Closing):
    """Writes frames in the order of their times.

    Raises InputError for an unknown suffix and for a format whose library is missing; what the
    file system refuses stays an OSError.
    """

    def __init__(self, path: Path) -> None:
        form = usable_format(path)
        options = {"channel": CHANNEL} if form.suffix == ".log" else {}
        with ExitStack() as stack:
            file: Any = stack.enter_context(path.open("w+b"))
            if is_compressed(path):
                # No name and no time inside, so that equal frames give equal bytes.
                file = stack.enter_context(gzip.GzipFile("", "wb", fileobj=file, mtime=0))
            if form.is_text:
                file = stack.enter_context(TextIOWrapper(file, encoding="utf-8"))
            self._lines = _CandumpLines(file) if form.suffix == ".log" else None
            if form.library and form.library not in sys.modules:
                # The command line has left it out; what is loaded now serves the same classes.
                importlib.reload(can.io.mf4)
            self._writer = MESSAGE_WRITERS[form.suffix](file, **options)
            self._files = stack.pop_all()

    def write(self, frame: LogFrame) -> None:
        """Append a frame."""
        if self._lines is not None:
            self._lines.write(frame.time_s, [frame[1:3]], frame.received, frame.is_extended)
            return
        self._writer.on_message_received(
            can.Message(
                timestamp=round(frame.time_s, 6),
                arbitration_id=frame.frame_id,
                data=frame.data,
                is_extended_id=frame.is_extended,
                is_rx=frame.received,
            )
        )

    def write_all(self, time_s: float, frames: Iterable[tuple[int, bytes]], received: bool) -> None:
        """Append data frames with 11-bit identifiers, all of one time and direction."""
        if self._lines is not None:
            self._lines.write(time_s, frames, received)
            return
        for frame_id, data in frames:
            self.write(LogFrame(time_s, frame_id, data, received=received))

    def close(self) -> None:
        """Complete the file."""
        with self._files:
            self._writer.stop()
