"""`bms replay --cells`: a pack's ECU answers a log of its own bus as it did, and says where not."""

from __future__ import annotations

import json
import re

import pytest

from hil_sim.logs import LogFrame, LogWriter, read_log
from hil_sim.monitor.pack_model import pack_codecs
from tests.hil_sim.command_line import bms
from tests.hil_sim.golden.record import FOLDER

CELLS = 5


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A charge of a pack, cut off by its time."""
    folder = tmp_path_factory.mktemp("pack")
    bms("sil", "--cells", CELLS, "--seed", 2, "--max-time-s", 20, "--out", folder / "out")
    return folder / "out" / "can.log"


def replayed(log, *options):
    done = bms("replay", log, "--cells", CELLS, "--json", *options)
    assert done.stderr == ""
    return done.returncode, json.loads(done.stdout)


def changed(log, path, change):
    """A copy of a log with frames that are changed by a function of frame and number."""
    with LogWriter(path) as writer:
        for number, frame in enumerate(read_log(log)):
            writer.write(change(number, frame))
    return path


def test_every_frame_of_a_charge_is_answered_as_it_was(log):
    code, content = replayed(log)
    assert (code, content["equal"], content["differing_periods"]) == (0, True, 0)
    assert content["periods"] > 200
    said = [frame for frame in read_log(log) if frame.received]
    assert content["frames"] == len(said)
    assert content["first_difference"] is None


def test_a_reading_that_is_another_is_answered_otherwise_and_the_first_period_named(log, tmp_path):
    codec = pack_codecs()["PackElectrical"]
    numbers = [n for n, frame in enumerate(read_log(log)) if frame.frame_id == codec.frame_id]
    at = numbers[150]

    def weaker(number, frame):
        if number != at:
            return frame
        values = codec.decode(frame.data)
        values["PackCurrent"] = -1.0
        data = codec.encode(values, codec.counter(frame.data))
        return LogFrame(frame.time_s, frame.frame_id, data, received=frame.received)

    code, content = replayed(changed(log, tmp_path / "other.log", weaker))
    assert (code, content["equal"]) == (1, False)
    assert content["first_difference"]["period"] == 150
    assert content["first_difference"]["signals"]


def test_constants_of_another_spread_or_map_answer_otherwise(log):
    code, content = replayed(log, "--spread", "none")
    assert (code, content["equal"]) == (1, False)
    recorded, now = content["first_difference"]["signals"]["WeakestStateOfCharge"]
    assert now < recorded  # counted by the capacity of the preset, not the smallest of the spread


def test_the_table_names_the_first_period_that_differs(log):
    done = bms("replay", log, "--cells", CELLS, "--spread", "none")
    assert done.returncode == 1
    assert re.search(r"answers that DIFFER", done.stdout)
    assert re.search(r"WeakestStateOfCharge +\d\.\d+ +\d\.\d+", done.stdout)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--cells", 4], "its ECU has 5 cells"),
        (["--cells", 5, "--preset", "a123_26650_10C"], "not 5 cells of 'a123_26650_10C'"),
        (["--cells", 5, "--against", "a", "b"], "--against: is for one cell"),
        (["--spread", "none"], "are for a pack; add --cells"),
    ],
)
def test_what_does_not_fit_the_log_is_refused_in_one_line(log, options, told):
    done = bms("replay", log, *options)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("keeps", "told"),
    [
        (lambda frame: frame.time_s > 5.0, "begins in the middle of a run"),
        (lambda frame: frame.time_s < 4.0 or not frame.received, "in the middle of a period"),
    ],
)
def test_a_part_of_a_log_is_refused(log, tmp_path, keeps, told):
    part = [frame for frame in read_log(log) if keeps(frame)]
    if told.startswith("in the"):
        part = [frame for frame in part if frame.time_s < 4.05]
    with LogWriter(tmp_path / "part.log") as writer:
        for frame in part:
            writer.write(frame)
    done = bms("replay", tmp_path / "part.log", "--cells", CELLS)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_log_of_one_cell_is_no_packs():
    done = bms("replay", FOLDER / "message_loss.log.gz", "--cells", 5)
    assert done.returncode == 2
    assert "holds no pack in lock step" in done.stderr
    assert len(done.stderr.splitlines()) == 1
