"""The faults of an ECU, bit n for fault n, from the two messages that carry them."""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.bus.catalog import FaultPage, FirstFault

FIRST_FAULTS = 20
"""Faults in Diagnostics; the later ones are in Diagnostics2."""


class FaultBits:
    """Takes what messages say; both numbers are None until Diagnostics has come.

    In Diagnostics2 active and latched faults take turns, so that the later ones of them are what
    was said last. Diagnostics clears those that are latched, as it names the first of all.
    """

    def __init__(self) -> None:
        self.active: int | None = None
        self.latched: int | None = None
        self._more = dict.fromkeys(FaultPage, 0)

    def take(self, value: Callable[[str], float | None]) -> None:
        """Take what messages say, from a function that gives the value of a signal."""
        more = value("MoreFaults")
        for page in FaultPage if more is not None else ():
            if more is not None and value("FaultPage") == page:
                self._more[page] = int(more) << FIRST_FAULTS
        first = value("FirstFault")
        if first == FirstFault.NONE:
            self._more[FaultPage.LATCHED] = 0
        elif first is not None and first >= FIRST_FAULTS:
            self._more[FaultPage.LATCHED] |= 1 << int(first)
        self.active = self._joined(value("ActiveFaults"), self.active, FaultPage.ACTIVE)
        self.latched = self._joined(value("LatchedFaults"), self.latched, FaultPage.LATCHED)

    def _joined(self, told: float | None, known: int | None, page: FaultPage) -> int | None:
        if told is None and known is None:
            return None
        early = int(told) if told is not None else (known or 0) % (1 << FIRST_FAULTS)
        return early | self._more[page]
