"""`bms replay` on logs of other tools and on damaged ones, and that its remedies work.

Each log is made from the first periods of a golden one, so that what replays equal there has to
replay equal here.
"""

import json
import re
import shlex
import sqlite3
import struct
import subprocess
import sys
import time
from itertools import takewhile

import can
import pytest

from bms.errors import InputError
from hil_sim.logs import LogFrame, LogWriter, Selection, read_log
from hil_sim.replay.beginning import require_beginning
from hil_sim.replay.recording import load_recording
from hil_sim.targets.scenarios import load_scenarios
from tests.hil_sim.dialects import DIALECTS, asc, asc_canfd, blf, candump_log
from tests.hil_sim.dialects.blf import blf_content, blf_of_content
from tests.hil_sim.golden.record import FOLDER, SCENARIOS

PERIODS = 35
FRAMES = tuple(
    takewhile(
        lambda frame: frame.time_s < PERIODS / 10, read_log(FOLDER / "charge_start.log.gz").frames
    )
)
COMMAND = 0x180


def put(folder, name, content):
    path = folder / name
    path.write_bytes(content)
    return path


def refused(bms, path, *options) -> str:
    """The one line of a refusal."""
    code, out, err = bms("replay", path, *options)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err.startswith(f"bms: {path}: ")
    return err


def replayed(bms, path, *options):
    """What --json says of a log that replays equal."""
    code, out, _ = bms("replay", path, "--json", *options)
    content = json.loads(out)
    assert (code, content["equal"], content["periods"]) == (0, True, PERIODS)
    return content


# --- Dialects ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", DIALECTS)
def test_a_log_of_any_tool_replays_equal(bms, tmp_path, name):
    dialect = DIALECTS[name]
    path = put(tmp_path, f"can{dialect.suffix}", dialect.write(FRAMES))
    assert set(replayed(bms, path)["unread"]) <= {"other_entries"}


def test_a_log_in_which_one_message_came_in_canfd_lines_replays_equal(bms, tmp_path):
    plain, fd = asc(FRAMES).splitlines(), asc_canfd(FRAMES).splitlines()
    start = len(plain) - len(FRAMES), len(fd) - len(FRAMES)
    lines = plain[: start[0]] + [
        fd[start[1] + n] if frame.frame_id == 0x101 else plain[start[0] + n]
        for n, frame in enumerate(FRAMES)
    ]
    replayed(bms, put(tmp_path, "mixed.asc", b"\n".join(lines) + b"\n"))


def test_a_log_that_begins_before_its_trigger_replays_equal(bms, tmp_path):
    replayed(bms, put(tmp_path, "negative.asc", asc(FRAMES, start_s=-1.05)))


@pytest.mark.parametrize(
    ("line", "unread"),
    [
        ("(0.900000) can0 300#1122334455667788_9 R", {"long_dlc_frames": 1}),
        ("(0.900000) can0 00123#80:00:00000000#1122 R", {"can_xl_frames": 1}),
        (
            "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)",
            {"lost_frames": 3},
        ),
        ("(0.900000) can0 12345678#00", {"extended_frames": 1}),
    ],
)
def test_one_foreign_line_is_counted_and_shown(bms, tmp_path, line, unread):
    lines = candump_log(FRAMES).decode().splitlines()
    place = next(n for n, frame in enumerate(FRAMES) if frame.time_s > 0.9)
    path = put(tmp_path, "can.log", "\n".join([*lines[:place], line, *lines[place:], ""]).encode())
    assert replayed(bms, path)["unread"] == unread
    (count,) = unread.values()
    assert f"not read: {count} frame" in bms("replay", path)[1].replace("CAN XL ", "")


def test_a_classical_frame_of_dlc_9_in_blf_is_counted(bms, tmp_path):
    content = blf(FRAMES)
    objects = blf_content(content)
    foreign = struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 48, 1, 2, 0, 0, 0)
    foreign += struct.pack("<HBBL8s", 1, 0, 9, 0x300, bytes(8))
    path = put(tmp_path, "dlc9.blf", blf_of_content(content, objects + foreign))
    assert replayed(bms, path)["unread"] == {"long_dlc_frames": 1}


# --- Several channels, relative times ------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".log", ".asc", ".csv", ".trc", ".blf"])
def test_two_channels_are_refused_until_one_is_chosen(bms, tmp_path, suffix):
    path = tmp_path / f"can{suffix}"
    savvycan = suffix == ".csv"
    if savvycan:  # python-can's has no channels
        lines = DIALECTS["SavvyCAN"].write(FRAMES).splitlines(keepends=True)
        other = [line.replace(b"x,0,", b"x,1,") for line in lines[1:]]
        path.write_bytes(b"".join([lines[0], *(a + b for a, b in zip(lines[1:], other))]))
    else:
        with can.Logger(path) as writer:
            for frame in FRAMES:
                for channel in (0, 1):
                    writer(
                        can.Message(
                            timestamp=frame.time_s,
                            arbitration_id=frame.frame_id,
                            data=frame.data,
                            is_extended_id=False,
                            channel=channel,
                        )
                    )
    said = refused(bms, path)
    match = re.search(r"2 channels .*choose one, as with --channel (\S+)$", said.strip())
    assert match, said
    content = replayed(bms, path, "--channel", match[1])
    assert content["unread"] == {"other_channel_frames": len(FRAMES)}


def test_relative_times_of_candump_are_added_up_when_told(bms, tmp_path):
    before = (FRAMES[0], *FRAMES)
    deltas = [f._replace(time_s=f.time_s - b.time_s) for f, b in zip(FRAMES, before)]
    path = put(tmp_path, "delta.log", candump_log(deltas))
    said = refused(bms, path)
    assert "time goes back" in said
    option = re.search(r"give (--\S+) if each time counts from the line before", said)[1]
    replayed(bms, path, option)


def test_targets_are_compared_on_one_channel_too(tmp_path):
    lines = zip(*(candump_log(FRAMES, channel=name).splitlines(True) for name in ("a0", "a1")))
    path = put(tmp_path, "both.log", b"".join(line for pair in lines for line in pair))
    with pytest.raises(InputError, match="2 channels"):
        load_scenarios([path])
    (scenario,) = load_scenarios([path], Selection("a1"))
    assert len(scenario.recording.periods) == PERIODS


# --- The beginning of a run ----------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_log_without_its_first_periods_is_refused_however_many_are_missing(name):
    """The counters return to 0 after 16 periods, the pattern of messages after 80."""
    recording = load_recording(FOLDER / f"{name}.log.gz")
    require_beginning(recording.path, recording.answers, recording.database)
    for missing in range(1, len(recording.periods)):
        with pytest.raises(InputError, match="begins in the middle of a run"):
            require_beginning(recording.path, recording.answers[missing:], recording.database)


@pytest.mark.parametrize("missing", [1, 15, 16, 17])
def test_the_refusal_says_by_what_and_what_to_do(bms, tmp_path, missing):
    frames = [frame for frame in FRAMES if frame.time_s > missing / 10 - 0.05]
    said = refused(bms, put(tmp_path, "can.log", candump_log(frames)))
    sign = "the first Identity is not" if missing == 16 else f"counter {missing % 16}"
    assert sign in said
    assert "start the recording before the ECU" in said


# --- Damage --------------------------------------------------------------------------------------


def test_an_object_of_size_0_ends_at_once(bms, tmp_path):
    content = blf(FRAMES)
    objects = bytearray(blf_content(content))
    struct.pack_into("<L", objects, 48 * 100 + 8, 0)
    path = put(tmp_path, "size0.blf", blf_of_content(content, bytes(objects)))
    started_s = time.monotonic()
    assert "cannot have 0 bytes" in refused(bms, path)
    assert time.monotonic() - started_s < 10.0


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda content: blf_of_content(content, blf_content(content), 5), "compression 5"),
        (lambda content: content[:16] + struct.pack("<Q", 144) + content[24:], "did not close it"),
        (lambda content: content[:-200], "cut off"),
        (lambda content: content[:16] + struct.pack("<Q", len(content) - 400) + content[24:-400],
         "cut off in the object"),
        (lambda content: blf_of_content(content, blf_content(content)[:-7]), "cut off"),
    ],
)  # fmt: skip
def test_a_blf_is_not_read_short_without_a_word(bms, tmp_path, damage, said):
    assert said in refused(bms, put(tmp_path, "can.blf", damage(blf(FRAMES))))


def test_a_container_whose_stream_is_cut_off_is_refused(bms, tmp_path):
    content = bytearray(blf(FRAMES))
    (size,) = struct.unpack_from("<L", content, 144 + 8)
    cut = 64  # bytes of the stream, with sizes that agree
    struct.pack_into("<L", content, 144 + 8, size - cut)
    short = bytearray(content[: 144 + size - cut])
    struct.pack_into("<Q", short, 16, len(short))
    assert "container at byte 144: cut off" in refused(bms, put(tmp_path, "z.blf", bytes(short)))


# --- Remedies ------------------------------------------------------------------------------------


def run(command: str) -> None:
    """In a shell, with python as the one that runs this."""
    command = re.sub(r"^python ", f"{shlex.quote(sys.executable)} ", command)
    subprocess.run(["sh", "-c", command], check=True, capture_output=True)


@pytest.mark.parametrize("suffix", [".log", ".log.gz"])
@pytest.mark.parametrize("name", ["can", "with 'blanks' in it"])
def test_remedy_an_end_for_the_last_line(bms, tmp_path, suffix, name):
    path = tmp_path / f"{name}{suffix}"
    with LogWriter(path) as writer:
        for frame in FRAMES:
            writer.write(frame)
    plain = path if suffix == ".log" else None
    if plain is None:
        run(f"gunzip {shlex.quote(str(path))}")
        plain = path.with_suffix("")
    plain.write_bytes(candump_log(FRAMES, has_direction=False).rstrip())
    if suffix == ".log.gz":
        run(f"gzip {shlex.quote(str(plain))}")
    run(re.search(r"if it is whole, add its end: ([^;]*)", refused(bms, path))[1].strip())
    replayed(bms, path)


def test_remedy_removal_of_half_a_line_then_of_half_a_period(bms, tmp_path):
    content = candump_log((*FRAMES, *(f._replace(time_s=3.5) for f in FRAMES[:8])))
    path = put(tmp_path, "can.log", content[:-10])
    run(re.search(r"else remove it: (.*)", refused(bms, path))[1])
    said = refused(bms, path)
    assert (
        f"cut off in the middle of a control period (after the ChargeCommand in line {len(FRAMES)}"
        in said
    )
    run(re.search(r"keep what is whole: (.*)", said)[1])
    replayed(bms, tmp_path / "whole-can.log")


def test_remedy_of_half_a_period_in_a_compressed_log(bms, tmp_path):
    path = tmp_path / "can.asc.gz"
    with LogWriter(path) as writer:
        for frame in (*FRAMES, *(f._replace(time_s=3.5) for f in FRAMES[:8])):
            writer.write(frame)
    run(re.search(r"keep what is whole: (.*)", refused(bms, path))[1])
    replayed(bms, tmp_path / "whole-can.asc")


def test_remedy_conversion_of_what_is_left_of_a_blf(bms, tmp_path):
    path = put(tmp_path, "can.blf", blf_of_content(blf(FRAMES), blf_content(blf(FRAMES))[:-20]))
    run(re.search(r"read what is left: (.*)", refused(bms, path))[1])
    said = refused(bms, tmp_path / "can-left.log")
    run(re.search(r"keep what is whole: (.*)", said)[1])
    code, out, _ = bms("replay", tmp_path / "whole-can-left.log", "--json")
    assert (code, json.loads(out)["periods"]) == (0, PERIODS - 1)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".csv", ".trc", ".blf", ".log.gz", ".asc.gz"])
@pytest.mark.parametrize("wrong", [".log", ".asc", ".csv", ".trc", ".blf", ".mf4", ".csv.gz"])
def test_remedy_another_name(bms, tmp_path, suffix, wrong):
    if suffix == wrong:
        return
    right, path = tmp_path / f"right{suffix}", tmp_path / f"can{wrong}"
    with LogWriter(right) as writer:
        for frame in FRAMES:
            writer.write(frame)
    right.rename(path)
    name = re.search(r"name it (\S+)$", refused(bms, path).strip())
    assert name
    assert name[1] == str(tmp_path / f"can{suffix}")
    replayed(bms, path.rename(name[1]))


def test_remedy_conversion_of_a_database_of_python_can(bms, tmp_path):
    path = tmp_path / "can.db"
    with can.SqliteWriter(path) as writer:
        for frame in FRAMES:
            writer(_message(frame))
    assert sqlite3.connect(path).execute("select count(*) from messages").fetchone()
    path = path.rename(tmp_path / "can.log")
    said = refused(bms, path)
    command = re.search(r"name it \.db and run '([^']*)'", said)[1]
    path.rename(tmp_path / "FILE.db")
    run(f"cd {tmp_path} && {shlex.quote(sys.executable)} {command.removeprefix('python ')}")
    replayed(bms, tmp_path / "FILE.log")


def _message(frame: LogFrame) -> can.Message:
    return can.Message(
        timestamp=frame.time_s,
        arbitration_id=frame.frame_id,
        data=frame.data,
        is_extended_id=False,
        is_rx=frame.received,
    )


def test_remedy_a_recording_from_the_start(bms, tmp_path):
    foreign = put(tmp_path, "foreign.log", b"(0.000000) can0 123#01 R\n")
    option = re.search(r"give a log of 'bms sil (--log) FILE'", refused(bms, foreign))[1]
    path = tmp_path / "run.log"
    assert bms("sil", "--max-time-s", 3, "--json", option, path)[0] == 1
    assert bms("replay", path)[0] == 0


@pytest.mark.parametrize("kind", ["folder", "pipe", "nothing", "unreadable"])
def test_what_is_no_file_is_refused_in_one_line(bms, tmp_path, kind):
    path = tmp_path / "can.log"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        subprocess.run(["mkfifo", path], check=True)
    elif kind == "unreadable":
        path = tmp_path.joinpath(*["long" * 60] * 20, "can.log")
    said = refused(bms, path)
    assert {"folder": "not a file", "pipe": "not a file", "nothing": "no such file"}.get(
        kind, "cannot be opened"
    ) in said
