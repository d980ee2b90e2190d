"""The serial line of the microcontroller ports: slcan text, ring buffers, and what gets lost."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.firmware.native_library import FIRMWARE, load_library

SOURCES = [FIRMWARE / "port" / f"{name}.c" for name in ("ring", "slcan", "slcan_link")]
HEADERS = ["include/can_frame.h", *(f"port/{name}.h" for name in ("ring", "slcan", "slcan_link"))]
BUFFER_BYTES = 1024
Frame = tuple[int, bytes]
frames = st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8))


class Line:
    """Both ends of the line of a board: the host's text, the board's frames."""

    def __init__(self, ffi: Any, lib: Any) -> None:
        self._ffi, self._lib = ffi, lib
        self._link = ffi.new("slcan_link_t *")

    def put(self, text: bytes) -> None:
        for byte in text:
            self._lib.slcan_link_put(self._link, byte)

    def received(self) -> list[Frame]:
        frame, found = self._ffi.new("can_frame_t *"), []
        while self._lib.slcan_link_receive(self._link, frame):
            found.append((frame.id, bytes(frame.data)[: frame.length]))
        return found

    def send(self, frame_id: int, data: bytes) -> None:
        frame = {"id": frame_id, "length": len(data), "data": data.ljust(8, b"\0")}
        self._lib.slcan_link_send(self._link, self._ffi.new("can_frame_t *", frame))

    def text(self) -> bytes:
        byte, text = self._ffi.new("uint8_t *"), bytearray()
        while self._lib.slcan_link_get(self._link, byte):
            text.append(byte[0])
        return bytes(text)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    return load_library(tmp_path_factory.mktemp("slcan"), SOURCES, HEADERS)


@pytest.fixture
def line(library: tuple[Any, Any]) -> Line:
    line = Line(*library)
    line.put(b"S6\rO\r")
    assert line.received() == [] and line.text() == b"\r\r"
    return line


def as_text(frame_id: int, data: bytes) -> bytes:
    return f"t{frame_id:03X}{len(data)}{data.hex().upper()}\r".encode()


def losses(text: bytes) -> tuple[int, int]:
    """Lines and frames lost, as the last report frame of the text says."""
    report = [entry for entry in re.split(rb"[\r\a]", text) if entry.startswith(b"t7F08")][-1]
    numbers = bytes.fromhex(report[5:].decode())
    return int.from_bytes(numbers[:4], "little"), int.from_bytes(numbers[4:], "little")


@given(frame=frames, lower=st.booleans())
def test_a_frame_of_the_host_arrives(library: tuple[Any, Any], frame: Frame, lower: bool) -> None:
    line, text = Line(*library), as_text(*frame)
    line.put(b"O\r" + (text.lower() if lower else text))
    assert line.received() == [frame]


@given(frame=frames)
def test_a_frame_for_the_host_is_written(library: tuple[Any, Any], frame: Frame) -> None:
    line = Line(*library)
    line.put(b"O\r")
    line.received()
    line.send(*frame)
    assert line.text() == b"\r" + as_text(*frame)


def test_a_closed_channel_carries_nothing(library: tuple[Any, Any]) -> None:
    line = Line(*library)
    line.send(0x180, b"\x01")
    line.put(as_text(0x100, b"\x01"))
    assert line.received() == []
    assert line.text() == b"\a"


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"V\r", b"V1010\r"),
        (b"N\r", b"N0000\r"),
        (b"F\r", b"F00\r"),
        (b"Z1\r", b"\r"),
        (b"S6\r", b"\r"),
        (b"s031C\r", b"\r"),
        (b"L\r", b"\r"),
        (b"\r", b""),
    ],
)
def test_commands_are_answered(line: Line, command: bytes, answer: bytes) -> None:
    line.put(command)
    assert line.received() == [] and line.text() == answer


@pytest.mark.parametrize("text", [b"T00000100101\r", b"r1000\r", b"R000001000\r"])
def test_frames_of_other_kinds_are_ignored(line: Line, text: bytes) -> None:
    line.put(text)
    assert line.received() == [] and line.text() == b""


@pytest.mark.parametrize(
    "text",
    [
        *(b"t\r", b"t10\r", b"t1001\r", b"t1001A\r", b"t1001AABB\r", b"t1009" + b"0" * 18 + b"\r"),
        *(
            b"t100\xff00\r",
            b"tG001AA\r",
            b"t1001AG\r",
            b"hello\r",
            b"t8000\r",
            b"tFFF0\r",
            b"t" * 40 + b"\r",
            b"O" * 27 + b"\r",
        ),
    ],
)
def test_what_is_no_line_is_refused(line: Line, text: bytes) -> None:
    line.put(text)
    assert line.received() == [] and line.text() == b"\a"
    line.put(as_text(0x101, b"\x02"))
    assert line.received() == [(0x101, b"\x02")]


@given(st.lists(st.binary(max_size=30), max_size=80))
def test_no_text_breaks_the_line(library: tuple[Any, Any], texts: list[bytes]) -> None:
    line = Line(*library)
    for text in texts:
        line.put(text)
        line.received()
        line.text()
    line.put(b"\rO\r" + as_text(0x123, b"\x07"))
    assert line.received() == [(0x123, b"\x07")]


def test_a_full_buffer_loses_whole_lines_and_counts_them(line: Line) -> None:
    sent = [(0x100 + n, bytes([n] * 8)) for n in range(100)]
    for frame in sent:
        line.put(as_text(*frame))
    received = line.received()
    assert received == sent[: len(received)], "a line that arrives is as it was sent"
    assert 40 < len(received) < 50, "the buffer holds 1024 bytes, a line 22"
    assert losses(line.text()) == (100 - len(received), 0)
    line.put(as_text(0x300, b""))
    assert line.received() == [(0x300, b"")], "there is room again"


@pytest.mark.parametrize("room", range(9))
def test_a_line_is_cut_off_anywhere_and_the_next_is_whole(line: Line, room: int) -> None:
    """With room for all of t1001AA but its end, the line arrives; with less it is lost."""
    line.put(b"Z" * (BUFFER_BYTES - 1 - room) + b"\r" + b"t1001AA\r")
    received = line.received()
    line.put(as_text(0x101, b"\xbb"))
    received += line.received()
    text = line.text()
    if room >= 7:
        assert received == [(0x100, b"\xaa"), (0x101, b"\xbb")]
        assert b"t7F0" not in text
    else:
        assert received == [(0x101, b"\xbb")]
        assert losses(text) == (1, 0)


def test_the_rest_of_a_line_that_was_cut_off_is_no_command(line: Line) -> None:
    line.put(b"Z" * (BUFFER_BYTES - 4) + b"\r" + b"t1001A")
    assert line.received() == [], "there is room again, in the middle of a line"
    line.put(b"C\r" + as_text(0x101, b"\xbb"))
    assert line.received() == [(0x101, b"\xbb")], "C would have closed the channel"


def test_a_host_that_does_not_read_loses_whole_frames_and_is_told(line: Line) -> None:
    for n in range(60):
        line.send(0x180, bytes([n] * 8))
    lines = line.text().split(b"\r")[:-1]
    assert lines == [as_text(0x180, bytes([n] * 8))[:-1] for n in range(len(lines))]
    line.send(0x180, b"")
    text = line.text()
    assert text.startswith(as_text(0x180, b""))
    assert losses(text) == (0, 60 - len(lines))
    line.send(0x180, b"")
    assert line.text() == as_text(0x180, b""), "what was reported is not reported again"


def test_losses_are_told_although_nothing_is_sent(line: Line) -> None:
    line.put(as_text(0x100, b"") * BUFFER_BYTES)
    received = line.received()
    assert losses(line.text()) == (BUFFER_BYTES - len(received), 0)
    assert line.received() == [] and line.text() == b"", "once"


def test_a_closed_channel_tells_no_losses(line: Line) -> None:
    line.put(b"C\r" + as_text(0x100, b"") * BUFFER_BYTES)
    assert line.received() == []
    assert b"t7F0" not in line.text()


def test_flags_tell_what_was_lost_since_they_were_asked_for(line: Line) -> None:
    line.put(b"S6\r" * 400)
    line.received()
    line.text()
    line.put(b"F\r")
    line.received()
    assert line.text().endswith(b"F01\r")
    for _ in range(60):
        line.send(0x180, bytes(8))
    line.text()
    line.put(b"F\rF\r")
    line.received()
    assert line.text().startswith(b"F02\rF00\r")


@pytest.mark.parametrize("written", [0, 2**32 - 1, 2**32 - 3])
def test_a_ring_works_on_when_its_counters_begin_anew(
    library: tuple[Any, Any], written: int
) -> None:
    ffi, lib = library
    ring, byte = ffi.new("ring_t *"), ffi.new("uint8_t *")
    ring.read = ring.written = written
    for value in range(6):
        assert lib.ring_put(ring, value)
        assert lib.ring_room(ring) == BUFFER_BYTES - 1
        assert lib.ring_get(ring, byte) and byte[0] == value
        assert not lib.ring_get(ring, byte)
    assert all(lib.ring_put(ring, 7) for _ in range(BUFFER_BYTES))
    assert not lib.ring_put(ring, 7) and lib.ring_room(ring) == 0
