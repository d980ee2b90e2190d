"""Logs of every format give back what was written, except for the gaps that the format states."""

import gzip
import importlib.util
from pathlib import Path

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.errors import InputError
from hil_sim.logs import (
    FORMATS,
    LogFrame,
    LogWriter,
    Selection,
    Unread,
    log_format,
    log_suffixes,
    read_log,
)

HAS_ASAMMDF = importlib.util.find_spec("asammdf") is not None
MICROSECOND = 1e-6


def needing_library(suffix: str):
    marks = pytest.mark.skipif(not HAS_ASAMMDF, reason="not run: asammdf is not installed")
    return pytest.param(suffix, marks=marks) if suffix == ".mf4" else suffix


each_suffix = pytest.mark.parametrize("suffix", [needing_library(s) for s in log_suffixes()])

identifiers = st.one_of(
    st.tuples(st.sampled_from([0, 1, 0x7FF]) | st.integers(0, 0x7FF), st.just(False)),
    st.tuples(st.sampled_from([0, 0x7FF, 0x800, 0x1FFFFFFF]) | st.integers(0, 0x1FFFFFFF))
    .map(lambda chosen: (*chosen, True)),
)  # fmt: skip
gaps_us = st.lists(st.integers(0, 3_600_000_000) | st.just(0), min_size=1, max_size=12)


@st.composite
def logs(draw) -> list[LogFrame]:
    time_us = draw(st.sampled_from([0, 1, 5_000_000, 1_700_000_000_123_457]))
    frames = []
    for gap_us in draw(gaps_us):
        frame_id, is_extended = draw(identifiers)
        data, received = draw(st.binary(max_size=8)), draw(st.booleans())
        frames.append(LogFrame(time_us / 1e6, frame_id, data, is_extended, received))
        time_us += gap_us
    return frames


def write(path: Path, frames: list[LogFrame]) -> Path:
    with LogWriter(path) as writer:
        for frame in frames:
            writer.write(frame)
    return path


@pytest.mark.parametrize("suffix", [s for s in log_suffixes() if s != ".mf4"])
@settings(max_examples=25)
@given(frames=logs())
def test_what_is_written_is_read_back(tmp_path_factory, suffix, frames):
    assert_read_back(tmp_path_factory.mktemp("log") / f"can{suffix}", frames)


@pytest.mark.slow
@pytest.mark.skipif(not HAS_ASAMMDF, reason="not run: asammdf is not installed")
def test_foreign_frames_and_channels_of_mdf_4_are_counted(tmp_path):
    path = tmp_path / "can.mf4"
    usual = {"arbitration_id": 0x100, "data": bytes(8), "is_extended_id": False}
    foreign = (
        {"channel": 1},
        {"dlc": 9},
        {"is_fd": True, "data": bytes(12)},
        {"is_remote_frame": True, "data": None},
        {"is_error_frame": True, "data": None},
    )
    with can.MF4Writer(path) as writer:
        writer(can.Message(timestamp=0.5, channel=0, **usual))
        for change in foreign:
            writer(can.Message(**{"timestamp": 1.0, "channel": 0, **usual, **change}))
    with pytest.raises(InputError, match=r"2 channels .* 0 \(1 frames\), 1 \(1 frames\)"):
        read_log(path)
    log = read_log(path, Selection("0"))
    assert list(log) == [LogFrame(0.5, 0x100, bytes(8))]
    assert log.unread == {
        Unread.OTHER_CHANNEL_FRAMES: 1,
        Unread.LONG_DLC_FRAMES: 1,
        Unread.CAN_FD_FRAMES: 1,
        Unread.REMOTE_FRAMES: 1,
        Unread.ERROR_FRAMES: 1,
    }


@pytest.mark.slow
@pytest.mark.skipif(not HAS_ASAMMDF, reason="not run: asammdf is not installed")
@settings(max_examples=3)
@given(frames=logs())
def test_what_is_written_as_mdf_4_is_read_back(tmp_path_factory, frames):
    """In fewer examples, for asammdf takes a second to come up."""
    assert_read_back(tmp_path_factory.mktemp("log") / "can.mf4", frames)


def assert_read_back(path: Path, frames: list[LogFrame]) -> None:
    form = log_format(path)

    read = list(read_log(write(path, frames)))

    assert [f[1:4] for f in read] == [f[1:4] for f in frames]
    directions = [frame.received or not form.keeps_direction for frame in frames]
    assert [frame.received for frame in read] == directions
    if form.keeps_start:
        assert [frame.time_s for frame in read] == [frame.time_s for frame in frames]
    else:
        since_start_s = [frame.time_s - frames[0].time_s for frame in frames]
        read_s = [frame.time_s - read[0].time_s for frame in read]
        assert read_s == pytest.approx(since_start_s, abs=MICROSECOND)


@each_suffix
def test_a_log_that_starts_at_zero_keeps_its_times_in_every_format(tmp_path, suffix):
    frames = [LogFrame(round(0.1 * n, 6), 0x100 + n, bytes(n), received=True) for n in range(9)]
    assert list(read_log(write(tmp_path / f"can{suffix}", frames))) == frames


@pytest.mark.parametrize(
    "suffix", [s for s in log_suffixes() if log_format(Path(f"x{s}")).is_reproducible]
)
def test_equal_frames_give_equal_bytes(tmp_path, suffix, monkeypatch):
    frames = [LogFrame(0.1 * n, 0x100, bytes([n])) for n in range(100)]
    one = write(tmp_path / f"one{suffix}", frames).read_bytes()
    monkeypatch.setattr("time.time", lambda: 4e9)
    assert write(tmp_path / f"other{suffix}", frames).read_bytes() == one


def test_a_compressed_log_is_the_plain_one_compressed(tmp_path):
    frames = [LogFrame(0.1, 0x100, b"\x01\x02", received=False)]
    plain = write(tmp_path / "can.log", frames).read_bytes()
    assert gzip.decompress(write(tmp_path / "can.log.gz", frames).read_bytes()) == plain
    assert plain == b"(0.100000) vcan0 100#0102 T\n"


@pytest.mark.parametrize("name", ["can", "can.txt", "can.gz", "can.blf.gz", "can.mf4.gz", "log"])
def test_another_suffix_is_refused_and_the_known_ones_are_listed(tmp_path, name):
    path = tmp_path / name
    for use in (LogWriter, lambda path: list(read_log(path))):
        with pytest.raises(
            InputError, match=r"\.log, \.asc, \.csv, \.trc, \.blf, \.mf4, \.log\.gz"
        ):
            use(path)
    assert not path.exists()


def test_suffixes_are_read_whatever_their_case(tmp_path):
    assert log_format(tmp_path / "CAN.LOG.GZ") is FORMATS[".log"]


def test_a_format_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr("hil_sim.logs.formats.find_spec", lambda name: None)
    path = tmp_path / "can.mf4"
    path.write_bytes(b"MDF     4.10    ")
    with pytest.raises(InputError, match=r"pip install 'kan-rcbf-bms\[mf4\]'"):
        list(read_log(path))
    with pytest.raises(InputError, match=r"pip install 'kan-rcbf-bms\[mf4\]'"):
        LogWriter(path)


def test_the_table_of_formats_in_the_documentation_is_true():
    lines = (Path(__file__).parents[2] / "docs" / "replay.md").read_text().splitlines()
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("| .")
    ]
    stated = {row[0]: [cell == "yes" for cell in row[2:]] for row in rows}
    assert stated == {
        suffix: [form.is_text, form.keeps_direction, form.keeps_start, form.is_reproducible]
        for suffix, form in FORMATS.items()
    }
