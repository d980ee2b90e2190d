"""The recording is a candump log that python-can reads back."""

import re

import can
from hypothesis import given
from hypothesis import strategies as st

from hil_sim.bus.buses import Frame
from hil_sim.logs.recorder import Recorder

entries = st.lists(
    st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8), st.booleans()), min_size=1, max_size=20
)


@given(entries)
def test_what_is_recorded_is_read_back(tmp_path_factory, entries):
    path = tmp_path_factory.mktemp("log") / "can.log"
    with Recorder(path) as recorder:
        for step, (frame_id, data, received) in enumerate(entries):
            recorder.record(step * 0.1, [Frame(frame_id, data)], received)
    with can.LogReader(path) as reader:
        read = [(m.arbitration_id, bytes(m.data), m.is_rx, m.timestamp) for m in reader]
    assert [entry[:3] for entry in read] == entries
    assert [entry[3] for entry in read] == [round(step * 0.1, 6) for step in range(len(entries))]


def test_lines_are_those_of_candump(tmp_path):
    with Recorder(tmp_path / "can.log") as recorder:
        recorder.record(0.0, [Frame(0x080, b"")], False)
        recorder.record(12.3, [Frame(0x180, b"\xd4\x19\x89\x37")], True)
    lines = (tmp_path / "can.log").read_text().splitlines()
    assert lines == ["(0.000000) vcan0 080# T", "(12.300000) vcan0 180#D4198937 R"]
    assert all(re.fullmatch(r"\(\d+\.\d{6}\) \S+ [0-9A-F]{3}#[0-9A-F]* [TR]", x) for x in lines)


@given(entries, st.floats(-1.0, 1e6))
def test_lines_are_those_that_python_can_writes(tmp_path_factory, entries, begin_s):
    """A first time below 0 s, and a later one before the first, among them."""
    folder = tmp_path_factory.mktemp("lines")
    times_s = [begin_s + step * (0.1 if step % 3 else -0.05) for step in range(len(entries))]
    with Recorder(folder / "can.log") as recorder:
        for time_s, (frame_id, data, received) in zip(times_s, entries):
            recorder.record(time_s, [Frame(frame_id, data)], received)
    with can.Logger(folder / "python_can.log", channel="vcan0") as logger:
        for time_s, (frame_id, data, received) in zip(times_s, entries):
            logger.on_message_received(
                can.Message(
                    round(time_s, 6), frame_id, is_extended_id=False, data=data, is_rx=received
                )
            )
    written = [(folder / name).read_bytes() for name in ("can.log", "python_can.log")]
    assert written[0] == written[1]
