"""Where the parts of an image stand in flash, as in firmware_c/linker/memory.ld."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

ERASED = 0xFF
"""What flash holds where nothing has been written."""


@dataclass(frozen=True)
class Region:
    """A range of addresses."""

    address: int
    length: int

    @property
    def end(self) -> int:
        """The first address that is no longer inside."""
        return self.address + self.length


@dataclass(frozen=True)
class MemoryMap:
    """The regions of every microcontroller target."""

    boot: Region
    floor: Region
    application: Region
    calibration: Region
    ram: Region


MEMORY_MAP = MemoryMap(
    boot=Region(0x0000, 4 * 1024),
    floor=Region(0x1000, 2 * 1024),
    application=Region(0x1800, 24 * 1024),
    calibration=Region(0x7800, 6 * 1024),
    ram=Region(0x2000_0000, 8 * 1024 - 32),
)

TARGETS = MappingProxyType({"mps2-an385": 385, "mps2-an386": 386})
"""Boards and the numbers by which images name them (TARGET_ID of the ports)."""
