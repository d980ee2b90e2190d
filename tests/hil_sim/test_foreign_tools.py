"""can-utils and cantools on a real vcan beside ECU, plant and monitor: the commands of the page."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import pyte
import pytest

from hil_sim.logs import LogFrame, read_log
from hil_sim.logs.recorder import Recorder
from hil_sim.run.session import run_both
from hil_sim.run.settings import Settings
from tests.hil_sim.command_line import bms
from tests.hil_sim.test_vcan import HAS_GUEST, HAS_VCAN, MISSING, run_in_guest

pytestmark = pytest.mark.skipif(not (HAS_VCAN or HAS_GUEST or "CI" in os.environ), reason=MISSING)

REPOSITORY = Path(__file__).parents[2]
PAGE = REPOSITORY / "docs" / "foreign-tools.md"
MALFORMED_BEGIN, RANDOM_BEGIN = 0x7E1, 0x7E2
MALFORMED_BEGIN_LINE = " 7E1#BE61"
COLUMNS, ROWS = 80, 24

# Without the optional reader of .mf4, whose import takes most of a command's start in the guest;
# exec, so that the process number of a job is the command's own. script starts $SHELL, which need
# not be set, and only bash knows the exported function.
SCRIPT = r"""
bms() {
  exec "$PYTHON" -c \
    'import sys; sys.modules["asammdf"] = None; from bms.cli import main; main()' "$@"
}
export -f bms
ecu_listens() { grep -q ' raw$' /proc/net/can/rcvlist_fil; }
candump_listens() { grep -q ' raw$' /proc/net/can/rcvlist_all; }
plant_ended() { ! kill -0 $plant 2> /dev/null; }
# What is on the screen by now, without its escape sequences.
shown() { tail -c 20000 screen | sed 's/\x1b\[[0-9;?]*[a-zA-Z]//g' | grep -aq "$1"; }
await() { until [ "$(grep -c "$1" charge.log)" -ge "$2" ] || plant_ended; do sleep 0.3; done; }

. ./record
. ./charge
plant=$!
mkfifo keys
export SHELL=$BASH
script -qfc "stty cols COLUMNS rows ROWS; bms monitor --bus socketcan:vcan0" screen < keys > out &
monitor=$!
exec 3> keys
await ' 080#' 250
until grep -q paper_calibrated screen || plant_ended; do sleep 0.3; done
. ./foreign_traffic
await ' 300#[0-9A-F]*$' 500
await ' [0-9A-F]\{8\}#' 500
await '#R' 250
await '##' 250
sleep 0.3
cansend vcan0 7E1#BE61
. ./malformed_frames
await ' 080#' $(($(grep -c ' 080#' charge.log) + 100))
until shown '101 Valid  *1 ' && shown '100 Valid  *0  *1 ' || plant_ended; do sleep 0.3; done
printf q >&3
wait $monitor
cansend vcan0 7E2#BE62
. ./random_frames
wait $plant
echo $? > plant.status
kill $(jobs -p)
wait

mkdir replayed
awk '/ 080#/ && ++periods > 120 { exit } { print }' charge.log > replayed/charge.log
cd replayed
. ../play
until ecu_listens && candump_listens; do sleep 0.3; done
sleep 0.2
. ../play_1
while ecu_listens; do sleep 0.3; done
kill $(jobs -p)
wait
"""


def commands() -> dict[str, str]:
    """Blocks of commands on the page by heading."""
    sections = re.split(r"^## (.*)\n", PAGE.read_text(), flags=re.M)
    blocks = {}
    for heading, text in zip(sections[1::2], sections[2::2]):
        name = heading.lower().replace(" ", "_")
        for number, block in enumerate(re.findall(r"(?:^    .*\n)+", text, flags=re.M)):
            blocks[f"{name}_{number}" if number else name] = block
    return blocks


@pytest.fixture(scope="module")
def guest(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("foreign_tools")
    for name, block in commands().items():
        (folder / name).write_text(block)
    script = SCRIPT.replace("COLUMNS", str(COLUMNS)).replace("ROWS", str(ROWS))
    done = run_in_guest("bash", "-c", script, folder=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def frames(guest) -> list[LogFrame]:
    """Classical data frames with 11-bit identifiers, as candump saw them."""
    return [frame for frame in read_log(guest / "charge.log") if not frame.is_extended]


def until(frame_id: int, frames: list[LogFrame]) -> list[LogFrame]:
    return list(takewhile(lambda frame: frame.frame_id != frame_id, frames))


def between(begin: int, end: int, frames: list[LogFrame]) -> list[LogFrame]:
    return until(end, frames)[len(until(begin, frames)) + 1 :]


def signals(database, name: str, frames: list[LogFrame]) -> list[dict[str, float | None]]:
    """Values of the intact frames of a message."""
    codec = database[name]
    decoded = (codec.decode(frame.data) for frame in frames if frame.frame_id == codec.frame_id)
    return [values for values in decoded if values is not None]


def test_with_foreign_traffic_and_a_monitor_the_bus_carries_the_frames_of_the_virtual_bus(
    guest, frames, preset, database, tmp_path
):
    own_ids = {codec.frame_id for codec in database.values()}
    dumped = [f for f in until(MALFORMED_BEGIN, frames) if f.frame_id in own_ids]
    periods = sum(frame.frame_id == database["SYNC"].frame_id for frame in dumped)
    with Recorder(tmp_path / "can.log") as recorder:
        run_both(Settings(preset, max_time_s=0.1 * periods), recorder)
    expected = list(read_log(tmp_path / "can.log"))
    assert periods > 250
    assert [(f.frame_id, f.data) for f in dumped] == [
        (f.frame_id, f.data) for f in expected[: len(dumped)]
    ]


def test_the_foreign_traffic_was_there(guest):
    text = (guest / "charge.log").read_text()
    lines = text.partition(MALFORMED_BEGIN_LINE)[0].splitlines()
    kinds = Counter(
        "fd" if "##" in line else "remote" if "#R" in line else "extended"
        for line in lines
        if re.search(r" [0-9A-F]{8}#|##|#R", line)
    )
    assert kinds["extended"] >= 500
    assert min(kinds["remote"], kinds["fd"]) >= 250
    # A remote or FD frame with that identifier, at random, is none of the 500.
    assert sum(bool(re.search(r" 300#[0-9A-F]*$", line)) for line in lines) == 500


def test_replay_reads_what_candump_recorded(guest, tmp_path):
    lines = (guest / "charge.log").read_text().splitlines(keepends=True)
    begin = next(n for n, line in enumerate(lines) if MALFORMED_BEGIN_LINE in line)
    last = max(n for n, line in enumerate(lines[:begin]) if " 180#" in line)
    log = tmp_path / "charge.log"
    log.write_text("".join(lines[: last + 1]))
    done = bms("replay", log)
    assert (done.returncode, done.stderr) == (0, "")
    assert "every frame of the ECU is the same" in done.stdout


def test_cantools_decodes_every_frame_to_the_same_values(guest, database):
    command = commands()["decode"].replace("python ", f"{shlex.quote(sys.executable)} ", 1)
    decoded = subprocess.run(
        ["bash", "-c", command.replace("codegen/", f"{shlex.quote(str(REPOSITORY))}/codegen/")],
        cwd=guest / "replayed",
        capture_output=True,
        text=True,
        check=True,
    )
    by_id = {codec.frame_id: codec for codec in database.values()}
    seen = Counter()
    for frame, line in zip(
        read_log(guest / "replayed" / "charge.log"), decoded.stdout.splitlines()
    ):
        codec = by_id[frame.frame_id]
        name, values = re.fullmatch(r".* :: (\w+)\((.*)\)", line).groups()
        assert name == codec.name
        texts = dict(item.split(": ") for item in values.split(", ")) if values else {}
        for signal, value in codec.decode(frame.data).items():
            choices = codec.choices.get(signal, {})
            text = texts[signal].split(" ")[0]
            if value is None:
                assert float(text) > 0.0
            elif value in choices:
                assert text == choices[value]
            else:
                assert float(text) == pytest.approx(value, rel=1e-9, abs=1e-9)
        seen[name] += 1
    # The plant sends no ChargeMode, and gets a Plan; BootRefusal is the boot stage's.
    assert set(seen) == set(database) - {"ChargeMode", "BootRefusal"}
    assert seen["ChargeCommand"] == seen["SYNC"] == 120


def test_a_log_that_canplayer_sends_gets_the_same_answers(guest):
    folder = guest / "replayed"
    difference = subprocess.run(
        ["bash", "-c", commands()["play_2"]],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (difference.returncode, difference.stdout, difference.stderr) == (0, "", "")
    assert sum(frame.frame_id >= 0x180 for frame in read_log(folder / "played.log")) > 600


def test_single_malformed_frames_are_counted_and_the_charge_goes_on(frames, database):
    during = between(MALFORMED_BEGIN, RANDOM_BEGIN, frames)
    reports = {
        int(report["ReportedMessage"]): [
            int(report[f"{kind}Frames"])
            for kind in ("WrongLength", "WrongCrc", "Repeated", "Lost", "Reordered")
        ]
        for report in signals(database, "NetworkDiagnostics", during)
    }
    assert reports == {
        0: [1, 0, 0, 0, 0],
        1: [0, 1, 0, 0, 0],
        2: [0, 0, 0, 0, 0],
        3: [0, 0, 0, 0, 0],
        4: [0, 0, 0, 0, 0],
    }
    assert all(report["LatchedFaults"] == 0 for report in signals(database, "Diagnostics", during))
    assert all(cmd["CommandCurrent"] < -1.0 for cmd in signals(database, "ChargeCommand", during))


def test_random_frames_end_in_a_fault_at_no_current_and_no_limit_is_crossed(
    guest, frames, database
):
    summary = json.loads((guest / "charge.json").read_text())
    assert (summary["stop_reason"], summary["limits_kept"]) == ("fault", True)
    assert (guest / "plant.status").read_text().strip() == "1"
    flooded = frames[len(until(RANDOM_BEGIN, frames)) :]
    diagnostics = database["Diagnostics"]
    latched = next(
        number
        for number, frame in enumerate(flooded)
        if frame.frame_id == diagnostics.frame_id
        and (values := diagnostics.decode(frame.data))
        and values["LatchedFaults"]
    )
    before = signals(database, "ChargeCommand", flooded[:latched])
    after = signals(database, "ChargeCommand", flooded[latched:])
    assert before[0]["CommandCurrent"] < -1.0
    assert after
    assert all(command["CommandCurrent"] == 0.0 for command in after)


def screens(stream: bytes) -> Iterator[str]:
    """The text of a terminal after each time that it was drawn."""
    display = pyte.Screen(COLUMNS, ROWS)
    feed = pyte.ByteStream(display)
    for drawn in stream.split(b"\x1b[H"):
        feed.feed(b"\x1b[H" + drawn)
        yield "\n".join(display.display)


def test_the_monitor_shows_the_charge_the_foreign_frames_and_the_malformed_ones(guest):
    stream = (guest / "screen").read_bytes().partition(b"\x1b[?1049l")
    assert stream[1], "left the screen"
    drawn = list(screens(stream[0]))
    # A plant that has to wait for the processor is stale for a moment, perhaps in the last of them.
    lively = [text for text in drawn if "stale" not in text.partition("\n")[0]]
    assert re.search(r"^ (Charging|Derated) +socketcan:vcan0 +lock step", lively[-1])
    text = drawn[-1]
    assert "paper_calibrated (" in text
    assert re.search(r"core estimate +\d+\.\d\d ± 0\.\d\d K .* limit 323.00 K", text)
    assert re.search(r"100 Valid +0 +1 +0 +0 +0", text)
    assert re.search(r"101 Valid +1 +0 +0 +0 +0", text)
    assert re.search(r"100 CellElectrical .* s +1  1", text)
    assert re.search(r"101 CellThermal .* s +1  1", text)
    assert int(re.search(r"foreign frames (\d+)", text)[1]) > 1000
    for kind in ("extended", "remote", "FD"):
        assert kind in text
    assert re.search("latched +none", text)
