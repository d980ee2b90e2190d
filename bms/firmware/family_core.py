"""The firmware's observer and decision for a family of cells, period by period without frames."""

from __future__ import annotations

from typing import Any

from bms.firmware._firmware import ffi, lib


def family_reading(**values: float | bool) -> Any:
    """Pointer to a family_reading_t with these fields."""
    return ffi.new("family_reading_t *", values)


class FamilyCore:
    """What is known of one cell of the family that a calibration block (bms_calibration_t) states.

    `state` is the firmware's family_t, and may be written to.
    """

    def __init__(self, block: Any) -> None:
        self._family, self._cell = ffi.addressof(block.family), ffi.addressof(block.rcbf)
        self._block = block
        self.state = ffi.new("family_t *")
        lib.family_reset(self.state, self._family)

    def observe(self, reading: Any) -> None:
        """Take the readings of a period."""
        lib.family_observe(self.state, self._family, self._cell, reading)

    def decide(self, reading: Any, reference_current_A: float) -> float:
        """Charging current in A, 0 or less; 0 where none is admitted."""
        decision = lib.family_decide(
            self.state, self._family, self._cell, reading, reference_current_A
        )
        return float(decision.current_A)

    def is_full(self, completion_soc: float) -> bool:
        """Whether no cell of the family can be less full than this."""
        return bool(lib.family_is_full(self.state, self._family, completion_soc))
