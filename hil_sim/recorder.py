"""Recording of a run with its time stamps, which are virtual unless it runs in real time."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

from hil_sim.bus import Frame
from hil_sim.logs import LogFrame, LogWriter


class Recorder:
    """Writes frames to log files of the formats that their suffixes name.

    Frames of the plant count as sent (T in a candump log), those of the ECU and others as received
    (R). Raises InputError as LogWriter does.
    """

    def __init__(self, *paths: Path) -> None:
        with ExitStack() as stack:
            self._writers = [stack.enter_context(LogWriter(path)) for path in paths]
            self._open = stack.pop_all()

    def record(self, time_s: float, frame: Frame, received: bool) -> None:
        """Append one frame at a time in s since the start of the run."""
        entry = LogFrame(time_s, frame.frame_id, frame.data, received=received)
        for writer in self._writers:
            writer.write(entry)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._open.close()
