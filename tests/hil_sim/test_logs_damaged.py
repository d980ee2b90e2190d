"""A log that is no good is refused in one line that names it, whatever is wrong with it."""

import gzip
import importlib.util

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.errors import InputError
from hil_sim.logs import LogWriter, log_suffixes, read_log
from hil_sim.replay.recording import load_recording
from tests.hil_sim.golden.record import FOLDER

HAS_ASAMMDF = importlib.util.find_spec("asammdf") is not None
SUFFIXES = [suffix for suffix in log_suffixes() if HAS_ASAMMDF or suffix != ".mf4"]
LINE = "(0.{:06}) vcan0 100#0102030405\n"


def text_log(path, text):
    path.write_text(text)
    return path


def refusal(path) -> str:
    with pytest.raises(InputError) as caught:
        list(read_log(path))
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message


@pytest.fixture(scope="module")
def intact(tmp_path_factory):
    """Bytes of one short recording in every format."""
    folder = tmp_path_factory.mktemp("intact")
    frames = list(read_log(FOLDER / "charge_start.log.gz"))[:150]
    whole = {}
    for suffix in SUFFIXES:
        with LogWriter(folder / f"can{suffix}") as writer:
            for frame in frames:
                writer.write(frame)
        whole[suffix] = (folder / f"can{suffix}").read_bytes()
    return whole


def test_missing_file(tmp_path):
    assert "no such file" in refusal(tmp_path / "can.log")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_empty_file(tmp_path, suffix):
    path = tmp_path / f"can{suffix}"
    path.write_bytes(b"")
    refusal(path)


def test_log_without_a_data_frame(tmp_path):
    assert "empty" in refusal(text_log(tmp_path / "can.log", "(0.000000) vcan0 100#R\n"))


def test_last_line_that_lacks_its_end(tmp_path):
    text = LINE.format(0) + LINE.format(100)
    assert len(list(read_log(text_log(tmp_path / "can.log", text)))) == 2
    # Two digits fewer would pass for a shorter frame.
    assert "cut off" in refusal(text_log(tmp_path / "can.log", text[:-3]))


def test_compressed_file_that_lacks_its_end(tmp_path):
    path = tmp_path / "can.log.gz"
    path.write_bytes(gzip.compress((LINE.format(0) * 1000).encode())[:-9])
    assert "cut off" in refusal(path)


@pytest.mark.parametrize("suffix", [".blf", ".log.gz"])
@pytest.mark.parametrize("missing_bytes", [1, 100, 1000])
def test_binary_file_that_lacks_its_end(tmp_path, intact, suffix, missing_bytes):
    path = tmp_path / f"can{suffix}"
    path.write_bytes(intact[suffix][:-missing_bytes])
    assert "cut off" in refusal(path)


def test_time_that_goes_back(tmp_path):
    text = LINE.format(300) + LINE.format(299)
    message = refusal(text_log(tmp_path / "can.log", text))
    assert "frame 2: time goes back from 0.000300 s to 0.000299 s" in message


def test_equal_times_are_in_order(tmp_path):
    path = text_log(tmp_path / "can.log", LINE.format(300) * 3)
    assert [frame.time_s for frame in read_log(path)] == [0.0003] * 3


@pytest.mark.parametrize(
    "line",
    [
        "hello world",
        "(zero) vcan0 100#00",
        "(0.1) vcan0 100",
        "(0.1) vcan0 XYZ#00",
        "(0.1) vcan0 100#0G",
        "\0\0\0\0",
    ],
)
def test_line_that_is_none_of_a_log(tmp_path, line):
    message = refusal(text_log(tmp_path / "can.log", LINE.format(0) + line + "\n"))
    assert "line 2: cannot be read as '.log'" in message


@pytest.mark.parametrize(
    "line",
    [
        "(nan) vcan0 100#00",
        "(inf) vcan0 100#00",
        "(0.1) vcan0 100#000102030405060708",
        "(0.1) vcan0 800#00",
    ],
)
def test_frame_that_no_bus_carries(tmp_path, line):
    assert ": line 1" in refusal(text_log(tmp_path / "can.log", line + "\n"))


def test_text_that_is_not_unicode(tmp_path):
    (tmp_path / "can.csv").write_bytes(b"\x80\x81,\xff\n")
    assert "cannot be read as '.csv'" in refusal(tmp_path / "can.csv")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_content_of_another_format(tmp_path, intact, suffix):
    for other, content in intact.items():
        if other != suffix:
            path = tmp_path / f"can{suffix}"
            path.write_bytes(content)
            refusal(path)


@st.composite
def damage(draw):
    """Replaces some bytes by others, and perhaps leaves out all that follows."""
    start, length = draw(st.floats(0.0, 1.0, exclude_max=True)), draw(st.integers(0, 40))
    new, goes_on = draw(st.binary(max_size=40)), draw(st.booleans())

    def apply(content: bytes) -> bytes:
        where = int(start * len(content))
        return content[:where] + new + (content[where + length :] if goes_on else b"")

    return apply


def assert_read_or_refused(read, path) -> None:
    try:
        read(path)
    except InputError as refused:
        assert str(refused).startswith(f"{path}: ")
        assert "\n" not in str(refused)


@pytest.mark.parametrize("suffix", [s for s in SUFFIXES if s != ".mf4"])
@settings(max_examples=50)
@given(damaged=damage())
def test_damaged_file_is_read_or_refused(tmp_path_factory, intact, suffix, damaged):
    path = tmp_path_factory.getbasetemp() / f"damaged{suffix}"
    path.write_bytes(damaged(intact[suffix]))
    assert_read_or_refused(lambda path: list(read_log(path)), path)


@settings(max_examples=50)
@given(damaged=damage())
def test_damaged_log_is_cut_into_periods_or_refused(tmp_path_factory, intact, damaged):
    path = tmp_path_factory.getbasetemp() / "cut.log"
    path.write_bytes(damaged(intact[".log"]))
    assert_read_or_refused(load_recording, path)


@pytest.mark.parametrize("name", ["long.log", "long.log.gz"])
def test_a_log_without_end_is_refused_before_it_fills_the_memory(tmp_path, monkeypatch, name):
    """Lines that repeat compress a thousandfold, so that the size of the file says nothing."""
    monkeypatch.setattr("hil_sim.logs.reader.MOST_ENTRIES", 10)
    path = tmp_path / name
    write = gzip.open if name.endswith(".gz") else open
    for lines in (10, 11):
        with write(path, "wt") as file:
            file.write("".join(LINE.format(n) for n in range(lines)))
        if lines == 10:
            assert len(list(read_log(path))) == 10
    assert "more than 10 entries" in refusal(path)
