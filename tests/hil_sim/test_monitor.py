"""`bms monitor` on a real pseudo-terminal and in a pipe, beside an ECU and a plant on one bus."""

from __future__ import annotations

import re
import signal
import subprocess
from contextlib import contextmanager
from threading import Event, Thread

import can
import pytest

from bms.firmware import Ecu
from hil_sim.bus.buses import Frame, open_bus
from hil_sim.bus.foreign import ForeignFrame
from hil_sim.monitor.listener import Listener
from hil_sim.nodes.ecu import EcuNode
from hil_sim.run.session import run_plant
from hil_sim.run.settings import Settings
from tests.hil_sim.command_line import bms
from tests.hil_sim.slcan_hub import FRAMES, SlcanHub
from tests.hil_sim.terminal import COMMAND, PATIENCE_S, Terminal

PAUSE_S = 0.04


@contextmanager
def charging(bus: str, preset, max_time_s: float):
    """Plant and firmware in lock step, each on a connection of its own; waits for the end.

    The ECU takes its time, so that a charge lasts long enough to be looked at on any machine.
    """
    stop = Event()

    def run_ecu():
        with open_bus(bus) as connection:
            node = EcuNode(connection, Ecu(preset=preset))
            while not stop.wait(PAUSE_S):
                node.answer(0.1)

    settings = Settings(preset, bus=bus, max_time_s=max_time_s, answer_timeout_s=PATIENCE_S)
    ecu = Thread(target=run_ecu, daemon=True)
    plant = Thread(target=run_plant, args=(settings,), daemon=True)
    ecu.start()
    plant.start()
    try:
        yield
    finally:
        plant.join()
        stop.set()
        ecu.join()


@pytest.fixture
def hub():
    with SlcanHub() as hub:
        yield hub


@pytest.fixture
def terminal(hub):
    terminal = Terminal("--bus", hub.bus)
    yield terminal
    terminal.close()


def test_the_screen_follows_a_charge_from_before_its_start_to_after_its_end(hub, terminal, preset):
    display = terminal.wait_for("waiting for frames")
    assert re.search("core estimate +n/a +limit n/a", display)
    (told,) = hub.commands
    with charging(hub.bus, preset, max_time_s=5.0):
        terminal.wait_for(
            r"^ Charging +slcan:socket://127.0.0.1:\d+ +lock step",
            r"model [0-9a-f]{8} +paper_calibrated",
            r"core estimate +28\d\.\d\d ± 0\.\d\d K +━.* limit 323.00 K",
            r"surface +28\d\.\d\d K +━.* limit 323.00 K",
            r"current +-\d+\.\d{3} A +━",
            r"command +-\d+\.\d{3} A +admitted -\d+\.\d{3} … 0.000 A +constraint none",
            r"180 ChargeCommand +\d+\.\d 0\.\d\d s +0",
            r"100 Valid( +0){5}",
            "foreign frames none",
            r"latched +none",
        )
        hub.send(b"t30080102030405060708")
        terminal.wait_for("foreign frames 1")
    display = terminal.wait_for(r"^ Charging +stale", "silent for", "180 ChargeCommand +stale")
    assert "━" not in display
    terminal.press(b"q")
    terminal.wait_for(r"watched slcan:\S+ for \d+\.\d s: \d+ frames")
    assert terminal.process.wait(PATIENCE_S) == 0
    assert terminal.current_settings() == terminal.settings
    # Listen only from the first command on: not even acknowledged, let alone a frame.
    assert told == [b"C", b"S6", b"L", b"C"]


def test_in_a_pipe_there_is_a_line_each_second_until_ctrl_c(hub, preset):
    process = subprocess.Popen(
        [*COMMAND, "--bus", hub.bus], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    first = process.stdout.readline()
    with charging(hub.bus, preset, max_time_s=5.0):
        pass
    lines = [first]
    while "stale" not in lines[-1]:
        lines.append(process.stdout.readline())
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, err) == (0, "")
    assert first.startswith("0.0 s  n/a; core estimate n/a (limit n/a); ")
    charge = [
        line for line in lines[1:-1] if re.match(r"\d+\.\d s  Charging; core estimate 28", line)
    ]
    assert charge
    assert re.search(r"command -\d+\.\d{3} A; admitted -\d+\.\d{3} … 0\.000 A; const", charge[-1])
    assert out.splitlines()[-1].startswith("watched slcan:")
    assert "\x1b" not in "".join(lines) + out
    assert not [command for command in hub.commands[0] if command[:1] in FRAMES]


def test_it_ends_by_itself_after_the_time_that_is_asked_for(hub):
    done = bms("monitor", "--bus", hub.bus, "--for-s", 0.3)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"watched \S+ for 0\.\d s: 0 frames", done.stdout.splitlines()[-1])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--bus", "virtual:bms"), "one process only"),
        (("--bus", "socketcan:not_there9"), "cannot be opened"),
        (("--bus", "nonsense"), "interface:channel"),
        (("--bus", "slcan:socket://127.0.0.1:9", "--preset", "nothing"), "nothing"),
        (("--bus", "slcan:socket://127.0.0.1:9"), "cannot be opened"),
        (("--bus", "virtual:bms", "--for-s", "0"), "--for-s"),
        ((), "--bus"),
    ],
)
def test_wrong_use_is_one_line_and_exit_code_2(bms, arguments, said):
    code, out, err = bms("monitor", *arguments)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_a_listener_has_no_way_to_send_and_tells_kinds_of_frames_apart():
    data = {"arbitration_id": 0x100, "data": b"\xab"}
    messages = [
        can.Message(**data, is_extended_id=False),
        can.Message(**data, is_extended_id=True),
        can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True, dlc=4),
        can.Message(arbitration_id=0x100, is_extended_id=False, is_error_frame=True),
        can.Message(**data, is_extended_id=False, is_fd=True),
    ]
    with Listener("virtual:kinds") as listener, can.Bus("kinds", interface="virtual") as other:
        for message in messages:
            other.send(message)
        frames = [listener.receive(1.0) for _ in messages]
        assert listener.receive(0.0) is None
        assert not hasattr(listener, "send")
    kinds = [ForeignFrame.EXTENDED, ForeignFrame.REMOTE, ForeignFrame.ERROR, ForeignFrame.FD]
    assert frames == [Frame(0x100, b"\xab"), *kinds]
