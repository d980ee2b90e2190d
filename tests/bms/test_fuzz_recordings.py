"""Whatever is done to a recording's bytes, it is read or refused in one line."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bms.commands.evaluate import Engine, evaluate
from bms.data.measurements import COLUMNS, Measurements, read_measurements
from bms.errors import InputError
from bms.model.model_file import shipped_model_path
from tests.bms.kan_samples import write_recording

EXAMPLES = 1000
ROWS = 12
PIECES = (
    b",", b";", b"\t", b"\n", b"\r\n", b"\r", b'"', b"'", b"\x00", b"\xff", b"\xef\xbb\xbf",
    b"nan", b"inf", b"-", b"1e308", b"-1e308", b"1e-320", b"1e999", b"0x1p3", b"1_0", b"#", b" ",
    b"\x0c", b"\x1c", b"\xc2\x85", b"\xe2\x80\xa8", "\u0663".encode(), "\u00b0C".encode("latin-1"),
    b"current_A", b"time_s,", b"voltage_V", b"9" * 400, b'"' + b"x" * 200_000,
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@pytest.fixture(scope="module")
def whole(folder):
    """Bytes of a sound recording with a voltage."""
    voltage_V = 3.4 - 0.01 * np.sin(np.arange(ROWS))
    return write_recording(folder / "whole.csv", rows=ROWS, voltage_V=voltage_V).read_bytes()


@st.composite
def damage(draw):
    """A change of bytes: cut, flipped bits, a piece put in, a stretch moved, a cell exchanged."""
    kind = draw(st.sampled_from(["cut", "flip", "insert", "move", "cell", "row"]))
    places = [draw(st.floats(0.0, 1.0)) for _ in range(3)]
    piece = draw(st.sampled_from(PIECES) | st.binary(max_size=6))
    bit = draw(st.integers(0, 7))

    def apply(content):
        one, two, three = sorted(round(place * len(content)) for place in places)
        if kind == "cut":
            return content[:one] + content[two:]
        if kind == "flip" and content:
            at = min(one, len(content) - 1)
            return content[:at] + bytes([content[at] ^ (1 << bit)]) + content[at + 1 :]
        if kind == "insert":
            return content[:one] + piece + content[one:]
        if kind == "move":
            return content[:one] + content[two:three] + content[one:two] + content[three:]
        separator = b"," if kind == "cell" else b"\n"
        cells = content.split(separator)
        cells[min(int(places[0] * len(cells)), len(cells) - 1)] = piece
        return separator.join(cells)

    return apply


def damaged(content, damages):
    for apply in damages:
        content = apply(content)
    return content


@settings(max_examples=EXAMPLES)
@given(damages=st.lists(damage(), min_size=1, max_size=4))
def test_damaged_recording_is_read_or_refused_in_one_line(folder, whole, damages):
    path = folder / "damaged.csv"
    path.write_bytes(damaged(whole, damages))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            recording = read_measurements(path)
        except InputError as error:
            (line,) = str(error).splitlines()
            assert line.startswith(str(path))
            return
    assert isinstance(recording, Measurements)
    for name in COLUMNS:
        values = getattr(recording, name)
        assert len(values) == len(recording.time_s) > 0
        assert np.all(np.isfinite(values))
    assert np.all(np.diff(recording.time_s) > 0.0)


@settings(max_examples=100)
@given(damages=st.lists(damage(), min_size=1, max_size=2))
def test_damaged_recording_ends_a_command_with_a_result_or_one_line(folder, whole, damages):
    """Called below the command line, so that it can be called many times."""
    path = folder / "damaged.csv"
    path.write_bytes(damaged(whole, damages))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            evaluate(shipped_model_path("lin2014"), data=path, engine=Engine.C, as_json=True)
        except InputError as error:
            assert len(str(error).splitlines()) == 1
