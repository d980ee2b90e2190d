"""BLF, with its objects packed in several ways."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from io import BytesIO

import can

from hil_sim.logs import LogFrame

SIZE = 128 * 1024


def blf(frames: Sequence[LogFrame], **options: int) -> bytes:
    file = BytesIO()
    file.close = lambda: None  # type: ignore[method-assign]
    with can.BLFWriter(file, **options) as writer:  # type: ignore[arg-type]
        for frame in frames:
            writer.on_message_received(message(frame))
    return file.getvalue()


def message(frame: LogFrame, **changes: object) -> can.Message:
    values: dict[str, object] = {
        "timestamp": frame.time_s,
        "arbitration_id": frame.frame_id,
        "data": frame.data,
        "is_extended_id": frame.is_extended,
        "is_rx": frame.received,
    }
    return can.Message(**(values | changes))  # type: ignore[arg-type]


_BLF_HEADER, _BLF_BASE, _BLF_CONTAINER = 144, struct.Struct("<4sHHLL"), struct.Struct("<H6xL4x")


def blf_content(log: bytes) -> bytes:
    """The objects of an intact file's containers, one after the other."""
    content, position = b"", _BLF_HEADER
    while position < len(log):
        _, _, _, size, _ = _BLF_BASE.unpack_from(log, position)
        method, _ = _BLF_CONTAINER.unpack_from(log, position + 16)
        inner = log[position + 32 : position + size]
        content += zlib.decompress(inner) if method == 2 else inner
        position += size + size % 4
    return content


def blf_of_content(header: bytes, content: bytes, method: int = 2, sizes: int = SIZE) -> bytes:
    """A file with these objects in containers; without containers if method is -1."""
    body = content if method == -1 else b""
    for start in range(0, len(content) if method >= 0 else 0, sizes):
        part = content[start : start + sizes]
        inner = zlib.compress(part, 1) if method == 2 else part
        size = 32 + len(inner)
        body += _BLF_BASE.pack(b"LOBJ", 16, 1, size, 10) + _BLF_CONTAINER.pack(method, len(part))
        body += inner + bytes(size % 4)
    whole = bytearray(header[:_BLF_HEADER] + body)
    struct.pack_into("<Q", whole, 16, len(whole))
    return bytes(whole)


def blf_in_containers(frames: Sequence[LogFrame], method: int, sizes: int = SIZE) -> bytes:
    log = blf(frames)
    return blf_of_content(log, blf_content(log), method, sizes)
