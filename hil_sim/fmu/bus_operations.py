"""CAN frames as bus operations of FMI-LS-BUS 1.0.0, and back."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Sequence

CAN_TRANSMIT = 0x10
_HEADER = struct.Struct("<II")
_FRAME = struct.Struct("<IIIBBH")
"""Code, length of the whole, identifier, whether it is extended, whether remote, data bytes."""


def transmit_operations(frames: Iterable[tuple[int, bytes]]) -> bytes:
    """A CAN Transmit operation for each frame, given by its 11-bit identifier and its data."""
    return b"".join(
        _FRAME.pack(CAN_TRANSMIT, _FRAME.size + len(data), frame_id, 0, 0, len(data)) + data
        for frame_id, data in frames
    )


def operations(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Code and arguments of each operation; ValueError for one that is damaged."""
    place = 0
    while place < len(data):
        if len(data) - place < _HEADER.size:
            raise ValueError(f"{len(data) - place} bytes are no bus operation")
        code, length = _HEADER.unpack_from(data, place)
        if not _HEADER.size <= length <= len(data) - place:
            raise ValueError(f"a bus operation of {length} bytes in {len(data) - place}")
        yield code, data[place + _HEADER.size : place + length]
        place += length


def transmitted_frames(data: bytes) -> Sequence[tuple[int, bytes]]:
    """Identifier and data of the frames among operations; ValueError as `operations`."""
    frames = []
    for code, arguments in operations(data):
        if code == CAN_TRANSMIT:
            frame_id, _, _, length = struct.unpack_from("<IBBH", arguments)
            frames.append((frame_id, arguments[8 : 8 + length]))
    return frames
