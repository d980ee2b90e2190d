"""Vector's binary format BLF.

python-can's reader decodes its objects well. But it loops for ever on an object of size 0, passes
over containers of another compression, over objects that lie outside containers and over the rest
of a compressed stream that is cut off, all without a word. So the structure is walked here first,
down to the single object, and only whole objects are handed to it. Source: python-can,
can/io/blf.py, and Vector_BLF by T. Lorenz, on which that is based.
"""

from __future__ import annotations

import shlex
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from can import BLFReader, Message

from hil_sim.bus.limits import MAX_DATA_LENGTH
from hil_sim.logs.frame import CutOffError, Entry, Unread, UnreadableError
from hil_sim.logs.numbers import LONG_DLCS

_FILE_HEADER = struct.Struct("<4sLBBBBBBBBQQLL8H8H")
_WHOLE_FILE_HEADER = 144
_BASE = struct.Struct("<4sHHLL")
_CONTAINER = struct.Struct("<H6xL4x")
_HEADERS = {1: 32, 2: 40}
"""Size of an object's header by its version."""
_MARK = b"LOBJ"
_LONGEST_PADDING = 4
_CONTAINER_TYPE = 10
_NOT_COMPRESSED, _ZLIB = 0, 2
_CONTENTS = {1: 16, 86: 16, 73: 32, 100: 84, 101: 40}
"""Least size of the content of the objects that python-can reads, by type: message (two versions),
error with details, CAN FD message (two versions)."""
_ERROR_TYPES = (2, 73)
_DLC_AT = {1: 3, 86: 3, 100: 3, 101: 1}
_FD_MESSAGE_64 = 101
_FD_MESSAGE_64_SIZES = struct.Struct("<2xB9xL19xB")
"""Valid bytes, flags, and where an extension begins, counted from the object's beginning."""
_EDL = 0x1000


class _Object(NamedTuple):
    number: int
    kind: int
    raw: bytes


def blf_entries(path: Path) -> Iterator[tuple[int, Entry]]:
    """The number of each object, and its entry.

    Raises UnreadableError, CutOffError for a file that ends too early, and OSError.
    """
    data = path.read_bytes()
    try:
        header = _file_header(data)
        objects = list(_objects(data))
    except CutOffError as error:
        log, left = (shlex.quote(str(p)) for p in (path, path.with_name(f"{path.stem}-left.log")))
        convert = f"python -m can.logconvert {log} {left}"
        raise CutOffError(str(error), f"record it again, or read what is left: {convert}") from None
    readable = []
    for item in objects:
        if item.kind in _CONTENTS:
            readable.append(item)
        else:
            kind = Unread.ERROR_FRAMES if item.kind in _ERROR_TYPES else Unread.OTHER_ENTRIES
            yield item.number, Entry(None, unread=kind)
    try:
        messages = list(BLFReader(BytesIO(_rebuilt(header, readable))))
    except Exception as error:  # python-can's reader is not made for damage and raises anything
        raise UnreadableError(f"python-can breaks down with {type(error).__name__}") from None
    if len(messages) != len(readable):
        raise UnreadableError(f"{len(readable)} messages are in it, {len(messages)} can be read")
    for item, message in zip(readable, messages):
        yield item.number, _entry(item.number, message)


def _file_header(data: bytes) -> bytes:
    if len(data) < _FILE_HEADER.size:
        raise CutOffError("cut off in its header")
    header = _FILE_HEADER.unpack_from(data)
    header_size, file_size = header[1], header[10]
    if not _FILE_HEADER.size <= header_size <= max(len(data), _WHOLE_FILE_HEADER):
        raise UnreadableError(f"its header cannot have {header_size} bytes")
    if file_size > len(data):
        raise CutOffError(f"cut off: {file_size} bytes are announced, {len(data)} are there")
    if file_size < len(data):
        raise CutOffError(
            f"its recorder did not close it: {file_size} bytes are announced, {len(data)} are "
            "there, and the last frames are missing"
        )
    return data[: _FILE_HEADER.size]


def _objects(data: bytes) -> Iterator[_Object]:
    """Every object of the file, those in containers instead of the containers."""
    start = _FILE_HEADER.unpack_from(data)[1]
    inside: list[bytes] = []
    found = 0
    outside = []
    for position, kind, raw in _walk(data, start, "byte"):
        if kind == _CONTAINER_TYPE:
            inside.append(_unpacked(raw, f"container at byte {position}"))
        else:
            outside.append((kind, raw))
    for _, kind, raw in _walk(b"".join(inside), 0, "unpacked byte"):
        found += 1
        yield _checked(found, kind, raw)
    for kind, raw in outside:
        found += 1
        yield _checked(found, kind, raw)


def _walk(data: bytes, position: int, unit: str) -> Iterator[tuple[int, int, bytes]]:
    """Position, type and bytes of one object after the other, up to the end."""
    while position < len(data):
        window = data[position : position + _LONGEST_PADDING + len(_MARK)]
        begin = window.find(_MARK)
        if begin < 0:
            if len(window) < len(_MARK) and not window.strip(b"\0"):
                return  # padding of the last object
            if len(window) < len(_MARK) + _LONGEST_PADDING:
                raise CutOffError(f"cut off at {unit} {position}")
            raise UnreadableError(f"no object begins at {unit} {position}")
        position += begin
        if position + _BASE.size > len(data):
            raise CutOffError(f"cut off in the object at {unit} {position}")
        _, header_size, _, size, kind = _BASE.unpack_from(data, position)
        if size < max(header_size, _BASE.size):
            raise UnreadableError(f"the object at {unit} {position} cannot have {size} bytes")
        if position + size > len(data):
            raise CutOffError(f"cut off in the object at {unit} {position}")
        yield position, kind, data[position : position + size]
        position += size


def _unpacked(raw: bytes, where: str) -> bytes:
    if len(raw) < _BASE.size + _CONTAINER.size:
        raise UnreadableError(f"{where}: it is too short")
    method, size = _CONTAINER.unpack_from(raw, _BASE.size)
    content = raw[_BASE.size + _CONTAINER.size :]
    if method == _ZLIB:
        unzip = zlib.decompressobj()
        try:
            content = unzip.decompress(content, size + 1)
        except zlib.error:
            raise UnreadableError(f"{where}: its compressed data are damaged") from None
    elif method == _NOT_COMPRESSED:
        return content
    else:
        raise UnreadableError(
            f"{where}: compression {method} is not known",
            "save it as .asc with the tool that wrote it",
        )
    if len(content) < size:
        raise CutOffError(f"{where}: cut off, {size} bytes are announced, {len(content)} are there")
    if len(content) > size:
        raise UnreadableError(f"{where}: there are more than the {size} bytes announced")
    return content


def _checked(number: int, kind: int, raw: bytes) -> _Object:
    if kind in _CONTENTS:
        _, header_size, version, size, _ = _BASE.unpack_from(raw)
        if _HEADERS.get(version) != header_size:
            raise UnreadableError(f"object {number}: version {version} of its header is not known")
        if size < header_size + _CONTENTS[kind] or not _has_its_data(kind, raw, header_size):
            raise UnreadableError(f"object {number}: {size} bytes are too few for its type")
        if kind in _DLC_AT and raw[header_size + _DLC_AT[kind]] > max(LONG_DLCS):
            raise UnreadableError(f"object {number}: no CAN frame has such a DLC")
    return _Object(number, kind, raw)


def _has_its_data(kind: int, raw: bytes, header_size: int) -> bool:
    """Whether all data are there; python-can fills up with zeros, as Vector does for CAN FD."""
    if kind != _FD_MESSAGE_64:
        return True
    valid, flags, extension_at = _FD_MESSAGE_64_SIZES.unpack_from(raw, header_size)
    room = (extension_at or len(raw)) - header_size - _CONTENTS[kind]
    return bool(flags & _EDL) or room >= valid


def _rebuilt(header: bytes, objects: list[_Object]) -> bytes:
    """A file of one container with these objects, and the header's start of measurement."""
    fields = list(_FILE_HEADER.unpack(header))
    fields[1] = _FILE_HEADER.size
    content = _CONTAINER.pack(_NOT_COMPRESSED, 0) + b"".join(item.raw for item in objects)
    base = _BASE.pack(_MARK, _BASE.size, 1, _BASE.size + len(content), _CONTAINER_TYPE)
    return _FILE_HEADER.pack(*fields) + base + content


def _entry(number: int, message: Message) -> Entry:
    unread = None
    if message.is_error_frame:
        unread = Unread.ERROR_FRAMES
    elif message.is_remote_frame:
        unread = Unread.REMOTE_FRAMES
    elif message.is_fd:
        unread = Unread.CAN_FD_FRAMES
    elif message.dlc > MAX_DATA_LENGTH and len(message.data) == MAX_DATA_LENGTH:
        unread = Unread.LONG_DLC_FRAMES
    elif len(message.data) != message.dlc:
        raise UnreadableError(
            f"object {number}: {message.dlc} bytes are announced, {len(message.data)} are there"
        )
    return Entry(
        float(message.timestamp),
        str(message.channel + 1) if isinstance(message.channel, int) else "",
        message.arbitration_id,
        bytes(message.data),
        message.is_extended_id,
        bool(message.is_rx),
        unread,
    )
