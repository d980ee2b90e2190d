"""Recording of a run with its time stamps, which are virtual unless it runs in real time."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import FrameId
from hil_sim.bus.closing import Closing
from hil_sim.logs import LogFrame, LogWriter


class Recorder(Closing):
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

    def close(self) -> None:
        """Complete the files."""
        self._open.close()


class PeriodRecorder(Recorder):
    """Keeps what the plant sends in each period of a lock-step run, in memory."""

    def __init__(self) -> None:
        super().__init__()
        self.periods: list[list[Frame]] = []
        self._sent: list[Frame] = []

    def record(self, time_s: float, frame: Frame, received: bool) -> None:
        """Keep one frame; SYNC ends the period."""
        if not received and frame.frame_id == FrameId.SYNC:
            self.periods.append(self._sent)
            self._sent = []
        elif not received:
            self._sent.append(frame)
