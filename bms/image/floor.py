"""The oldest firmware version that a board takes, in a sector of its own (image_floor_t)."""

from __future__ import annotations

import struct

from bms.image.memory_map import MEMORY_MAP

_RECORD = struct.Struct("<II")
FLOOR_LENGTH = _RECORD.size
_ERASED_WORD = 0xFFFF_FFFF


def floor_of(flash: bytes) -> int:
    """The oldest version that this flash takes; 0 where it takes any.

    Raises ValueError for a record that is damaged or cut off.
    """
    start = MEMORY_MAP.floor.address
    record = flash[start : start + FLOOR_LENGTH]
    if len(record) < FLOOR_LENGTH:
        raise ValueError(f"there are {len(flash)} bytes, and it stands behind byte {start}")
    version, inverted = _RECORD.unpack(record)
    if version == inverted == _ERASED_WORD:
        return 0
    if version ^ inverted != _ERASED_WORD:
        raise ValueError(f"version {version} and its inverse {inverted} do not belong together")
    return int(version)


def with_floor(image: bytes, version: int) -> bytes:
    """The image for a board that takes this version and newer ones."""
    start = MEMORY_MAP.floor.address
    record = _RECORD.pack(version, version ^ _ERASED_WORD)
    return image[:start] + record + image[start + FLOOR_LENGTH :]
