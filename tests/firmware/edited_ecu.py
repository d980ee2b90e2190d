"""The firmware with other constants than its preset and model make, which it keeps to itself."""

from __future__ import annotations

from collections.abc import Mapping

from bms.firmware import Ecu
from bms.firmware._firmware import ffi, lib
from bms.image import UNKNOWN_CONTENT


class EditedEcu(Ecu):
    """A plant refuses an ECU that tells of an edited calibration; this one tells of none."""

    def __init__(self, preset: str, changes: Mapping[str, float]) -> None:
        super().__init__(preset, changes=dict(changes))
        start = ffi.new("bms_start_t *", {"calibration_content": UNKNOWN_CONTENT})
        lib.bms_tell_start(self._state, start)
