"""Whether what is on a bus is one cell or a pack."""

from __future__ import annotations

from hil_sim.bus.buses import Frame
from hil_sim.bus.database import load_codecs
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.monitor.model import Snapshot, SystemModel
from hil_sim.monitor.pack_model import PackModel, PackSnapshot


class BusModel:
    """A cell until an intact frame of a pack's own has come, and none of a cell's; else a pack."""

    def __init__(self, cells: int | None = None) -> None:
        """With `cells` it is a pack of so many, whatever comes."""
        self._is_pack = cells is not None
        self._is_one = False
        self._one = SystemModel(load_codecs())
        self._pack = PackModel(cells)
        self.frames = 0

    def take(self, time_s: float, frame: Frame | ForeignFrame) -> None:
        """Count a frame and keep what it says."""
        self.frames += 1
        if not self._is_pack:
            self._one.take(time_s, frame)
        if not self._is_one:
            self._pack.take(time_s, frame)

    def snapshot(self, now_s: float) -> Snapshot | PackSnapshot:
        """What is known at a time in s, not before that of the last frame."""
        if self._is_pack:
            return self._pack.snapshot(now_s)
        one = self._one.snapshot(now_s)
        # A busy bus leaves no time for a second look at each frame.
        self._is_one = self._is_one or _is_heard(one)
        if self._pack.is_heard and not self._is_one:
            return self._pack.snapshot(now_s)
        return one


def _is_heard(snapshot: Snapshot) -> bool:
    return any(one.age_s is not None and one.name != "SYNC" for one in snapshot.messages)
