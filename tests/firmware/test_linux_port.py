"""The firmware as a native process on a real SocketCAN interface, in the guest with vcan0."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.firmware.ports import build_variant
from tests.hil_sim.test_vcan import GUEST, HAS_GUEST

NO_GUEST = "not run: no user-mode-linux: apt-get install -y user-mode-linux"
needs_guest = pytest.mark.skipif(not (HAS_GUEST or "CI" in os.environ), reason=NO_GUEST)

FLOOD = 20_000
# Nothing but the standard library, whose imports are slow enough in the guest.
DRIVER = """
import signal, socket, struct, subprocess, sys, time

program, flood = sys.argv[1], int(sys.argv[2])
bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
bus.bind(("vcan0",))

def send(frame_id, data=b""):
    bus.send(struct.pack("=IB3x8s", frame_id, len(data), data))

def heard(wait_s):
    bus.settimeout(wait_s)
    ids = []
    try:
        while True:
            ids.append(struct.unpack("=IB3x8s", bus.recv(16))[0])
    except TimeoutError:
        return ids

def started(*options):
    ecu = subprocess.Popen([program, "vcan0", *options], stdout=subprocess.PIPE, text=True)
    assert ecu.stdout.readline().strip() == "ECU on vcan0: listening"
    return ecu

def report(name, ecu):
    said = ecu.communicate()[0].strip()
    print(name, ecu.returncode, said, flush=True)

EXTENDED, REMOTE = 0x80000000, 0x40000000
ecu = started()
send(0x080)
print("answer", *(f"{n:X}" for n in heard(0.3)), flush=True)
send(0x123 | EXTENDED)
send(0x123 | REMOTE)
send(0x123, b"foreign")
time.sleep(0.2)
ecu.terminate()
report("terminated", ecu)

ecu = started("--silence-s", "0.5")
send(0x7FF)
before = time.monotonic()
report("silence", ecu)
print("lasted", time.monotonic() - before, flush=True)

ecu = started()
for _ in range(10):
    send(0x7FF)
    time.sleep(0.1)
ecu.send_signal(signal.SIGINT)
report("clock", ecu)

ecu = started()
ecu.send_signal(signal.SIGSTOP)
for _ in range(flood):
    send(0x7FF, b"12345678")
ecu.send_signal(signal.SIGCONT)
time.sleep(1.5)
ecu.terminate()
report("flood", ecu)

ecu = started()
subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
report("down", ecu)

report("absent", subprocess.Popen([program, "vcan7"], stdout=subprocess.PIPE, text=True))
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With the undefined-behaviour sanitizer; the address sanitizer finds no room in the guest."""
    return build_variant("linux", tmp_path_factory.mktemp("port"), "SANITIZE=1") / "bms_ecu"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "bms_ecu vcan0 --silence-s 5"),
        (["--help"], "bms_ecu vcan0 --silence-s 5"),
        (["vcan0", "vcan1"], "bms_ecu vcan0 --silence-s 5"),
        (["vcan0", "--silence-s"], "bms_ecu vcan0 --silence-s 5"),
        (["vcan0", "--silence-s", "soon"], "--silence-s 'soon': not a time"),
        (["vcan0", "--silence-s", "0.05"], "--silence-s '0.05': not a time"),
        (["vcan0", "--silence-s", "nan"], "--silence-s 'nan': not a time"),
        (["vcan0", "--silence-s", "1e9"], "--silence-s '1e9': not a time"),
        (["none0"], "bus 'none0': "),
    ],
)
def test_wrong_use_is_told_in_one_line(program, arguments, said):
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("bms_ecu: ")
    assert said in line


@pytest.fixture(scope="module")
def guest(program, tmp_path_factory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("guest")
    (folder / "driver.py").write_text(DRIVER)
    done = subprocess.run(
        [GUEST, sys.executable, "-S", "driver.py", program, str(FLOOD)],
        cwd=folder,
        env={**os.environ, "VCAN_FORCE": "1", "VCAN_TIMEOUT_S": "60"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines = (line.partition(" ") for line in done.stdout.splitlines())
    return {**{name: rest for name, _, rest in lines}, "stderr": done.stderr}


def figures(report: str) -> dict[str, int]:
    """Exit code and counts of a line that the process left."""
    pattern = (
        r"(?P<code>\d+) ECU on vcan0: (?P<received>\d+) frames received, (?P<steps>\d+) steps, "
        r"frames lost: (?P<unread>\d+) unread, (?P<unsent>\d+) unsent"
    )
    match = re.fullmatch(pattern, report)
    assert match, report
    return {name: int(text) for name, text in match.groupdict().items()}


@needs_guest
def test_a_sync_is_answered_and_the_command_comes_last(guest):
    assert guest["answer"].split() == [
        *("181", "182", "183", "184", "185", "186", "187", "189", "18A"),
        "180",
    ]


@needs_guest
def test_only_data_frames_with_11_bits_are_seen_and_sigterm_ends_well(guest):
    assert figures(guest["terminated"]) == {
        "code": 0,
        "received": 2,
        "steps": 1,
        "unread": 0,
        "unsent": 0,
    }


@needs_guest
def test_silence_after_the_first_frame_ends_the_process(guest):
    assert figures(guest["silence"])["code"] == 0
    assert 0.4 < float(guest["lasted"]) < 1.5


@needs_guest
def test_without_sync_it_steps_on_its_own_clock(guest):
    seen = figures(guest["clock"])
    assert (seen["code"], seen["received"]) == (0, 10)
    assert 8 <= seen["steps"] <= 12


@needs_guest
def test_frames_that_it_was_too_slow_to_read_are_counted_and_fail_the_run(guest):
    seen = figures(guest["flood"])
    assert seen["code"] == 1
    assert seen["unread"] > 0
    assert seen["received"] + seen["unread"] == FLOOD


@needs_guest
def test_an_interface_that_is_absent_or_goes_down_is_told(guest):
    assert figures(guest["down"])["code"] == 2
    assert guest["absent"].split()[0] == "2"
    down, absent = guest["stderr"].splitlines()
    assert down.startswith("bms_ecu: bus 'vcan0': ")
    assert "ip link set dev" in down
    assert absent.startswith("bms_ecu: bus 'vcan7': ")
    assert "vcan_guest.sh" in absent
