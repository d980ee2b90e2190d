"""`bms flash`: what gets into the emulated flash, what is refused, and what runs from it."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from bms.errors import InputError
from bms.firmware import Ecu
from bms.firmware.image_header import FIRMWARE_VERSION
from bms.image import MEMORY_MAP, calibration_part, with_floor
from bms.model.pair import load_pair
from hil_sim.bus.buses import Frame, open_bus
from hil_sim.targets import Emulation, Flash
from tests.firmware.bench import HEALTHY, MEASURED, frame
from tests.firmware.damaged_images import BOARD, damaged_images, resealed
from tests.firmware.ports import built, image, needs_emulator

pytestmark = needs_emulator

IMAGE = "firmware.bin"
SYNC = Frame(0x080, b"")
COMMAND_ID = 0x180
ANSWER_TIMEOUT_S = 10.0


@pytest.fixture
def flash(tmp_path: Path) -> Flash:
    """Flash with the present firmware."""
    flash = Flash(tmp_path / "flash" / "board.bin", BOARD)
    flash.program(built("mps2_an386") / IMAGE)
    return flash


@pytest.fixture(scope="module")
def lin2014(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("part") / "calibration.bin"
    path.write_bytes(calibration_part(*load_pair("lin2014", None)))
    return path


def flashed() -> bytes:
    """The image as it stands in flash: the board takes no older one from now on."""
    return with_floor(image(), FIRMWARE_VERSION)


def answers(path: Path, periods: int) -> list[list[tuple[int, bytes]]]:
    """What a board with this flash answers to healthy measurements, period by period."""
    said = []
    with Emulation(path, BOARD) as board, open_bus(board.bus) as bus:
        for period in range(periods):
            for name in MEASURED:
                bus.send(Frame(*frame(name, period, HEALTHY)))
            bus.send(SYNC)
            said.append([])
            while not said[-1] or said[-1][-1][0] != COMMAND_ID:
                heard = bus.receive(ANSWER_TIMEOUT_S)
                assert heard is not None, "the board is silent"
                said[-1].append((heard.frame_id, heard.data))
    return said


def expected(preset: str, periods: int) -> list[list[tuple[int, bytes]]]:
    ecu, said = Ecu(preset), []
    for period in range(periods):
        for name in MEASURED:
            ecu.receive(*frame(name, period, HEALTHY))
        ecu.receive(*SYNC)
        ecu.step()
        said.append(ecu.transmit())
    return said


def test_an_image_is_taken_over_and_described(bms, tmp_path):
    path = tmp_path / "flash.bin"
    command = ["flash", "--image", built("mps2_an386") / IMAGE, "--flash", path, "--no-start"]
    code, out, _ = bms(*command, "--json")
    report = json.loads(out)
    assert code == 0 and path.read_bytes() == flashed()
    preset, model = load_pair("paper_calibrated", None)
    assert report["model_hash"] == model.hash[:8] and report["preset_hash"] == preset.hash[:8]
    assert report["target"] == f"qemu:{BOARD}" and report["flash"] == str(path)
    code, out, _ = bms("flash", "--flash", path, "--no-start")
    assert code == 0 and model.hash[:8] in out and len(out.splitlines()) == 1


def test_another_model_s_calibration_runs_on_the_same_code(flash, lin2014):
    flash.program(calibration=lin2014)
    present, region = flash.path.read_bytes(), MEMORY_MAP.calibration
    assert present[: region.address] == flashed()[: region.address]
    assert present[region.address :] == lin2014.read_bytes()
    assert answers(flash.path, 12) == expected("lin2014", 12)


def test_the_calibration_that_was_built_in_runs(flash):
    assert answers(flash.path, 12) == expected("paper_calibrated", 12)


def test_a_bad_image_changes_nothing(flash, tmp_path):
    path = tmp_path / "bad.bin"
    for damaged in damaged_images(image()).values():
        path.write_bytes(damaged.image)
        with pytest.raises(InputError, match=r"bad\.bin: .*; "):
            flash.program(path)
        assert [file.name for file in flash.path.parent.iterdir()] == [flash.path.name]
        assert flash.path.read_bytes() == flashed()


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda part: part[:-1], "truncated"),
        (lambda part: part + b"\0", "bytes behind its end"),
        (lambda part: part[:200] + b"\1" + part[201:], "damaged"),
        (lambda part: resealed(part, firmware_version=1), "another firmware version"),
        (lambda part: resealed(part, calibration_layout=1), "another layout"),
        (lambda part: b"", "missing"),
        (lambda part: image(), "another kind"),
    ],
    ids=["truncated", "longer", "damaged", "older firmware", "older layout", "empty", "image"],
)
def test_a_bad_calibration_changes_nothing(flash, lin2014, tmp_path, bms, damage, words):
    path = tmp_path / "bad.bin"
    path.write_bytes(damage(lin2014.read_bytes()))
    code, out, error = bms("flash", "--calibration", path, "--flash", flash.path, "--no-start")
    assert (code, out) == (2, "")
    assert words in error and error.startswith(f"bms: {path}: ") and len(error.splitlines()) == 1
    assert flash.path.read_bytes() == flashed()


def test_image_and_calibration_are_taken_over_together_or_not_at_all(flash, lin2014, tmp_path):
    other, bad = Flash(tmp_path / "other.bin", BOARD), tmp_path / "bad.bin"
    bad.write_bytes(lin2014.read_bytes()[:-8])
    with pytest.raises(InputError):
        other.program(flash.path, bad)
    assert not other.path.exists()
    other.program(flash.path, lin2014)
    assert other.path.read_bytes().endswith(lin2014.read_bytes())


def test_a_damaged_calibration_in_flash_can_be_replaced(flash, lin2014):
    flash.path.write_bytes(damaged_images(image())["calibration damaged"].image)
    with pytest.raises(InputError, match="damaged"):
        flash.headers()
    flash.program(calibration=lin2014)
    flash.headers()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--calibration", "c.bin"], "flash is empty"),
        ([], "flash is empty"),
        (["--image", "absent.bin"], "cannot be read"),
        (["--image", "mps2_an386/firmware.elf"], "ELF file"),
        (["--image", "mps2_an386/firmware.hex"], "Intel HEX file"),
        (["--image", "mps2_an385/firmware.bin"], "another board"),
        (["--target", "mps2-an386"], "choose one of qemu:mps2-an386, qemu:mps2-an385"),
        (["--target", "qemu:virt"], "choose one of"),
        (["--image", "mps2_an386/firmware.bin", "--flash", "/proc/x/f.bin"], "cannot be written"),
    ],
)
def test_wrong_use_is_told_in_one_line(bms, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(built("mps2_an385").parent)
    code, out, error = bms("flash", "--flash", tmp_path / "flash.bin", "--no-start", *arguments)
    assert (code, out) == (2, "")
    assert words in error and len(error.splitlines()) == 1
    assert not (tmp_path / "flash.bin").exists()


def test_a_port_in_use_is_told(flash):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port {port}: .*choose another"):
            Emulation(flash.path, BOARD, port)


def test_a_log_that_cannot_be_written_is_told_in_one_line(bms, flash, tmp_path):
    log = tmp_path / "nowhere" / "qemu.log"
    code, _, error = bms("flash", "--flash", flash.path, "--log", log)
    assert code == 2
    assert error.startswith(f"bms: {log}: cannot be written") and len(error.splitlines()) == 1


def test_the_command_runs_the_board_until_it_is_told_to_end(flash):
    command = [sys.executable, "-c", "from bms.cli import main; main()"]
    command += ["flash", "--flash", str(flash.path), "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        bus_name = json.loads(process.stdout.readline())["bus"]
        with open_bus(bus_name) as bus:
            bus.send(SYNC)
            assert bus.receive(ANSWER_TIMEOUT_S) is not None
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
    port = int(bus_name.rpartition(":")[2])
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), 1.0)
