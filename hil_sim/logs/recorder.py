"""Recording of a run with its time stamps, which are virtual unless it runs in real time."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from hil_sim.bus.buses import Frame
from hil_sim.bus.catalog import FrameId
from hil_sim.bus.closing import Closing
from hil_sim.logs import LogWriter


class Recorder(Closing):
    """Writes frames to log files of the formats that their suffixes name.

    Frames of the plant count as sent (T in a candump log), those of the ECU and others as received
    (R). Raises InputError as LogWriter does.
    """

    def __init__(self, *paths: Path) -> None:
        with ExitStack() as stack:
            self._writers = [stack.enter_context(LogWriter(path)) for path in paths]
            self._open = stack.pop_all()

    def record(self, time_s: float, frames: Sequence[Frame], received: bool) -> None:
        """Append frames of one time in s since the start of the run."""
        for writer in self._writers:
            writer.write_all(time_s, frames, received)

    def close(self) -> None:
        """Complete the files."""
        self._open.close()


class PeriodRecorder(Recorder):
    """Keeps what the plant sends in each period of a lock-step run, in memory."""

    def __init__(self) -> None:
        super().__init__()
        self.periods: list[list[Frame]] = []
        self._sent: list[Frame] = []

    def record(self, time_s: float, frames: Sequence[Frame], received: bool) -> None:
        """Keep what is sent; SYNC ends the period."""
        for frame in () if received else frames:
            if frame.frame_id == FrameId.SYNC:
                self.periods.append(self._sent)
                self._sent = []
            else:
                self._sent.append(frame)
