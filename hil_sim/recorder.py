"""Recording of a run in the format of `candump -L`, with virtual time stamps."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import can

from hil_sim.bus import Frame

CHANNEL = "vcan0"
"""Name in the log whatever the bus was, so that equal runs give equal logs and canplayer plays."""


class Recorder:
    """Writes frames to a log file; T marks those of the plant, R those of the ECU and others."""

    def __init__(self, path: Path) -> None:
        self._writer = can.CanutilsLogWriter(path, channel=CHANNEL)

    def record(self, time_s: float, frame: Frame, received: bool) -> None:
        """Append one frame at a time in s since the start of the run."""
        self._writer.on_message_received(
            can.Message(
                timestamp=time_s,
                arbitration_id=frame.frame_id,
                data=frame.data,
                is_extended_id=False,
                is_rx=received,
            )
        )

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._writer.stop()
