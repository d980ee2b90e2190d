"""Writing of logs with python-can's writers."""

from __future__ import annotations

import gzip
from contextlib import ExitStack
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import can
from can.io.logger import MESSAGE_WRITERS

from hil_sim.bus.closing import Closing
from hil_sim.logs.formats import is_compressed, usable_format
from hil_sim.logs.frame import LogFrame

CHANNEL = "vcan0"
"""Name in a candump log whatever the bus was, so that equal runs give equal logs and canplayer
plays."""


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
            self._writer = MESSAGE_WRITERS[form.suffix](file, **options)
            self._files = stack.pop_all()

    def write(self, frame: LogFrame) -> None:
        """Append a frame."""
        self._writer.on_message_received(
            can.Message(
                timestamp=round(frame.time_s, 6),
                arbitration_id=frame.frame_id,
                data=frame.data,
                is_extended_id=frame.is_extended,
                is_rx=frame.received,
            )
        )

    def close(self) -> None:
        """Complete the file."""
        with self._files:
            self._writer.stop()
