"""The end of an slcan line that plant and monitor hold; the other end is a few lines of text."""

from __future__ import annotations

import time
from collections.abc import Callable

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bms.errors import BusError
from hil_sim.bus.buses import Frame, open_bus, open_interface
from hil_sim.bus.slcan import _message
from tests.hil_sim.lines import Line, frame, text

SYNC = Frame(0x080, b"")
SETTINGS = b"C\rS6\rO\r"
frames = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))


def soon(is_so: Callable[[], bool]) -> bool:
    """Whether something comes true within a second; the other end is a thread."""
    for _ in range(100):
        if is_so():
            return True
        time.sleep(0.01)
    return False


def silent(line: bytes) -> bytes:
    return b""


def after_sync(said: bytes):
    return lambda line: said if frame(line) == SYNC else b""


def test_the_channel_is_opened_at_500_kbit_per_s_and_closed_at_the_end():
    with Line(silent) as line, open_bus(line.bus) as bus:
        bus.receive(0.05)
    assert b"".join(line.chunks) == SETTINGS + b"C\r"


def test_a_listener_opens_the_channel_for_listening_only():
    with Line(silent) as line:
        open_interface(line.bus, listen_only=True).shutdown()
    assert b"".join(line.chunks) == b"C\rS6\rL\rC\r"


def test_the_frames_of_a_period_leave_together_when_the_sender_listens():
    sent = [Frame(0x100, b"\x5e\x25\xef"), Frame(0x101, b""), SYNC]
    with Line(silent) as line, open_bus(line.bus) as bus:
        assert bus.receive(0.05) is None
        assert soon(lambda: b"".join(line.chunks) == SETTINGS)
        before = len(line.chunks)
        for one in sent:
            bus.send(one)
        time.sleep(0.05)
        assert len(line.chunks) == before
        bus.receive(0.05)
        assert soon(lambda: line.chunks[before:] == [b"t10035E25EF\rt1010\rt0800\r"])


def test_frames_are_not_kept_back_for_ever():
    with Line(silent) as line, open_bus(line.bus) as bus:
        for _ in range(3000):
            bus.send(Frame(0x7FF, b"12345678"))
        assert soon(lambda: len(b"".join(line.chunks)) > len(SETTINGS))
    assert b"".join(line.chunks).count(b"t7FF8") == 3000


@given(frames)
def test_what_is_written_reads_back(one):
    message = _message(text(*one).rstrip(b"\r"))
    assert (message.arbitration_id, bytes(message.data)) == one
    assert message.is_extended_id is False


@given(st.from_regex(rb"[trTR][0-9A-Fa-f +_x]{0,28}", fullmatch=True))
def test_no_text_is_taken_for_a_frame_that_it_is_not(line):
    message = _message(line)
    if message is not None:
        kind = "R" if message.is_remote_frame else "T"
        kind = kind if message.is_extended_id else kind.lower()
        width = 8 if message.is_extended_id else 3
        said = f"{message.arbitration_id:0{width}X}{message.dlc}{message.data.hex().upper()}"
        assert message.arbitration_id <= (0x1FFFFFFF if message.is_extended_id else 0x7FF)
        assert line[:1].decode() == kind
        assert line[1:].decode().upper().startswith(said)


@pytest.mark.parametrize("line", [b"T1FFFFFFF21122", b"r1238", b"R123456780"])
def test_a_listener_sees_the_other_kinds_of_frames_and_a_node_does_not(line):
    said = after_sync(line + b"\r" + text(0x181, b""))
    with Line(said) as end, open_bus(end.bus) as bus:
        bus.send(SYNC)
        assert bus.receive(0.5) == Frame(0x181, b"")
    with Line(said) as end:
        bus = open_interface(end.bus)
        bus.send(can.Message(arbitration_id=0x080, is_extended_id=False))
        message = bus.recv(0.5)
        bus.shutdown()
    assert message.is_extended_id is (line[:1] in b"TR")
    assert message.is_remote_frame is (line[:1] in b"rR")
    assert message.dlc == int(line[9:10] if message.is_extended_id else line[4:5])


def test_frames_are_found_however_the_text_is_cut_and_whatever_is_between():
    said = b"\r\rV1010\rF00\rT00000100z\r" + text(0x181, b"\x01\x02") + b"z\r" + text(*SYNC)
    cut = said.index(b"t181") + 6
    parts = [said[:cut], said[cut:]]
    with Line(lambda line: parts.pop(0) if frame(line) else b"") as line, open_bus(line.bus) as bus:
        bus.send(SYNC)
        assert bus.receive(0.1) is None
        bus.send(SYNC)
        assert [bus.receive(0.5), bus.receive(0.5)] == [Frame(0x181, b"\x01\x02"), SYNC]


def test_a_refused_setting_is_no_matter_but_a_refused_frame_is():
    said = [b"\a\a" + text(*SYNC), b"\a"]
    with Line(lambda line: said.pop(0) if frame(line) else b"") as line, open_bus(line.bus) as bus:
        bus.send(SYNC)
        assert bus.receive(1.0) == SYNC
        bus.send(SYNC)
        with pytest.raises(BusError, match="refused a frame; bytes were lost"):
            bus.receive(1.0)


def test_a_line_that_is_hung_up_is_told():
    with Line(after_sync(b"hang up")) as line, open_bus(line.bus) as bus:
        bus.send(SYNC)
        with pytest.raises(BusError, match="has closed the line"):
            bus.receive(1.0)


@pytest.mark.parametrize(
    ("channel", "said"),
    [
        ("socket://127.0.0.1:1", "Connection refused"),
        ("socket://127.0.0.1", "is not socket://HOST:PORT"),
        ("socket://127.0.0.1:99999", "99999"),
        ("socket://:5000", "is not socket://HOST:PORT"),
    ],
)
def test_where_nobody_listens_the_remedy_is_told_in_one_line(channel, said):
    with pytest.raises(BusError, match="see that an image or adapter listens there") as caught:
        open_bus(f"slcan:{channel}")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
