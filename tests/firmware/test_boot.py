"""The boot stage on the board: it starts what is in order, and else sends no current and why."""

from __future__ import annotations

import shutil
import struct
import time
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from cantools.database.can.c_source import camel_to_snake_case

from bms.firmware._firmware import lib
from bms.firmware.image_checks import IMAGE_OK, IMAGE_STATUS_NAMES
from codegen import can_database
from hil_sim.bus.buses import Frame, open_bus
from hil_sim.bus.database import load_codecs
from hil_sim.bus.e2e import Receiver
from hil_sim.targets import Emulation
from tests.firmware.damaged_images import (
    APPLICATION,
    BOARD,
    RAM,
    VECTORS,
    damaged_images,
    parts,
    patched,
    with_parts,
)
from tests.firmware.monitor import monitor, monitor_options
from tests.firmware.native_library import FIRMWARE, load_library
from tests.firmware.ports import ROOT, build, image, needs_emulator

pytestmark = needs_emulator

CODECS = load_codecs()
SPOKEN = ("Diagnostics", "Identity", "BootRefusal", "ChargeCommand")
PARTS = ("APPLICATION", "CALIBRATION", "BOOT")
CALIBRATION_FAULT, FAULT_STATE = 18, 5
VERSION = can_database.network_version(can_database.load_database())
SOURCES = [FIRMWARE / "boot" / "refusal.c"]
SOURCES += [FIRMWARE / "src" / "e2e.c"]
SOURCES += [FIRMWARE / "generated" / f"{name}.c" for name in ("can_db", "can_catalog")]
HEADERS = ["include/can_frame.h", "image/image.h", "boot/refusal.h"]
ANSWER_TIMEOUT_S = 10.0  # the machine may be busy
SILENCE_S = 1.0
UNDEFINED = 0xDE00DE00
BOOTED = [
    *("boot stage with a flipped bit", "application damaged", "another board"),
    *("calibration damaged", "calibration for an older firmware"),
]


def put(content: bytes, folder: Path) -> Path:
    path = folder / "flash.bin"
    path.write_bytes(content)
    return path


def heard(
    path: Path, periods: int, timeout_s: float = ANSWER_TIMEOUT_S
) -> list[tuple[float, Frame]]:
    """(time in s, frame) up to that many charge commands, or until timeout_s of silence."""
    frames = []
    with Emulation(path, BOARD) as board, open_bus(board.bus) as bus:
        while periods and (frame := bus.receive(timeout_s)) is not None:
            frames.append((time.monotonic(), frame))
            periods -= frame.frame_id == CODECS["ChargeCommand"].frame_id
    return frames


def refusal(frames: list[Frame]) -> tuple[str, str] | None:
    """Part and check that the frames name; None when nothing is said."""
    names = CODECS["BootRefusal"].choices
    for frame in frames:
        if frame.frame_id == CODECS["BootRefusal"].frame_id:
            values = CODECS["BootRefusal"].decode(frame.data)
            part = names["RefusedPart"][int(values["RefusedPart"])]
            check = camel_to_snake_case(names["FailedCheck"][int(values["FailedCheck"])])
            return part.upper().removesuffix("STAGE"), check.upper()
    return None


STATUSES = [name for name in IMAGE_STATUS_NAMES.values() if name != IMAGE_OK]


def says_no_current_and_why(frames: list[Frame], part: str, status: str) -> None:
    """Every frame intact and in sequence, as a charger checks it."""
    receivers = {CODECS[name].frame_id: Receiver(CODECS[name]) for name in SPOKEN}
    values = [receivers[frame.frame_id].accept(frame.data) for frame in frames]
    assert None not in values
    for value in values:
        assert value.get("CommandCurrent", 0.0) == 0.0
        assert value.get("CommandState", FAULT_STATE) == FAULT_STATE
        assert value.get("DiagnosticState", FAULT_STATE) == FAULT_STATE
        assert value.get("FirstFault", CALIBRATION_FAULT) == CALIBRATION_FAULT
        for faults in ("ActiveFaults", "LatchedFaults"):
            assert value.get(faults, 1 << CALIBRATION_FAULT) == 1 << CALIBRATION_FAULT
        assert value.get("FirmwareVersion", 0) == 0
        assert value.get("NetworkVersion", VERSION) == VERSION
    assert refusal(frames) == (part, status)


@pytest.fixture(scope="module")
def refusals(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    return load_library(tmp_path_factory.mktemp("refusal"), SOURCES, HEADERS)


def frames_of(library: tuple[Any, Any], part: str, status: str, periods: int = 40) -> list[Frame]:
    ffi, native = library
    frames, spoken = ffi.new("can_frame_t[]", len(SPOKEN)), []
    for period in range(periods):
        code = getattr(native, f"REFUSAL_{part}"), getattr(native, f"IMAGE_{status}")
        native.refusal_frames(*code, period, frames)
        spoken += [Frame(f.id, bytes(f.data)[: f.length]) for f in frames]
    return spoken


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("status", STATUSES)
def test_a_refusal_is_told_by_frames_that_the_charger_trusts(
    refusals: tuple[Any, Any], part: str, status: str
) -> None:
    name = status.removeprefix("IMAGE_")
    frames = frames_of(refusals, part, name)
    says_no_current_and_why(frames, part, name)
    assert [f.frame_id for f in frames[: len(SPOKEN)]] == [CODECS[name].frame_id for name in SPOKEN]


@pytest.mark.parametrize(
    "change",
    [
        (".command_current = no_current()", ".command_current = no_current() - 500u"),
        (".command_state = (uint8_t)BMS_FAULT", ".command_state = (uint8_t)BMS_STANDBY"),
        (".diagnostic_state = (uint8_t)BMS_FAULT", ".diagnostic_state = (uint8_t)BMS_STANDBY"),
        (".first_fault = (uint8_t)FAULT_CALIBRATION", ".first_fault = 0u"),
        (".active_faults = faults,", ""),
        (".latched_faults = faults,", ""),
        ("(uint8_t)period", "0u"),
        ("if (MESSAGES[i]->is_protected)", "if (period == 0u)"),
        (".failed_check = (uint8_t)status,", ""),
        (".refused_part = (uint8_t)part,", ""),
        (".network_version = CAN_NETWORK_VERSION", ".network_version = 0u"),
        ("write_refusal(part, status, &frames[2]);", ""),
    ],
    ids=lambda change: change[0],
)
def test_a_broken_refusal_is_noticed(change: tuple[str, str], tmp_path: Path) -> None:
    library = load_library(tmp_path, SOURCES, HEADERS, ("refusal.c", *change))
    with pytest.raises((AssertionError, KeyError)):
        says_no_current_and_why(frames_of(library, "BOOT", "WRONG_CRC"), "BOOT", "WRONG_CRC")


def test_what_is_in_order_is_started(tmp_path: Path) -> None:
    with Emulation(put(image(), tmp_path), BOARD) as board, open_bus(board.bus) as bus:
        assert bus.receive(SILENCE_S) is None, "the application waits for a first frame"
        bus.send(Frame(CODECS["SYNC"].frame_id, b""))
        answer = [bus.receive(ANSWER_TIMEOUT_S) for _ in range(10)]
    assert answer[-1] is not None and answer[-1].frame_id == CODECS["ChargeCommand"].frame_id
    identity = CODECS["Identity"].decode(answer[4].data) if answer[4] else {}
    assert identity["FirmwareVersion"] == lib.BMS_FIRMWARE_VERSION


@pytest.mark.parametrize("name", BOOTED)
def test_the_board_tells_why_it_does_not_start(name: str, tmp_path: Path) -> None:
    damaged = damaged_images(image())[name]
    frames = [frame for _, frame in heard(put(damaged.image, tmp_path), periods=2)]
    says_no_current_and_why(frames, damaged.part, damaged.status)


def test_the_board_tells_it_every_100_ms(tmp_path: Path) -> None:
    damaged = damaged_images(image())["calibration damaged"]
    spoken = heard(put(damaged.image, tmp_path), periods=12)
    says_no_current_and_why([frame for _, frame in spoken], damaged.part, damaged.status)
    times_s = [at for at, frame in spoken if frame.frame_id == CODECS["ChargeCommand"].frame_id]
    assert median(b - a for a, b in pairwise(times_s)) == pytest.approx(0.1, abs=0.04)


def test_no_charge_begins_with_a_damaged_calibration(bms: Any, tmp_path: Path) -> None:
    damaged = damaged_images(image())["calibration damaged"]
    with Emulation(put(damaged.image, tmp_path), BOARD) as board:
        code, _, error = bms("plant", "--bus", board.bus, "--max-time-s", 3)
    assert code == 2
    assert "boot stage refuses the calibration" in error


def mutant(tree: Path, *changes: tuple[str, str]) -> bytes:
    """Image with a boot stage in which texts are replaced."""
    image()
    for folder in ("firmware_c", "build/firmware/mps2_an386"):
        shutil.copytree(ROOT / folder, tree / folder)
    source = tree / "firmware_c" / "port" / "cortex_m" / "boot.c"
    text = source.read_text()
    for old, new in changes:
        assert old in text, "the change no longer applies; bring it up to date"
        text = text.replace(old, new)
    source.write_text(text)
    return (build("mps2_an386", tree) / "firmware.bin").read_bytes()


def answers_sync(path: Path) -> bool:
    """Whether the application has started: it says its version when a period begins."""
    with Emulation(path, BOARD) as board, open_bus(board.bus) as bus:
        bus.send(Frame(CODECS["SYNC"].frame_id, b""))
        while (frame := bus.receive(ANSWER_TIMEOUT_S)) is not None:
            if frame.frame_id == CODECS["Identity"].frame_id:
                version = CODECS["Identity"].decode(frame.data)["FirmwareVersion"]
                return version == lib.BMS_FIRMWARE_VERSION
    return False


@pytest.mark.parametrize(
    ("call", "name"),
    [
        ("image_check_boot", "boot stage with a flipped bit"),
        ("image_check_application", "application damaged"),
        ("image_check_calibration", "calibration damaged"),
    ],
)
def test_without_a_check_what_is_damaged_would_start(call: str, name: str, tmp_path: Path) -> None:
    unchecked = f"status = {call}(", f"status = IMAGE_OK; (void){call}("
    careless = mutant(tmp_path / "tree", unchecked)
    assert not answers_sync(put(damaged_images(image())[name].image, tmp_path))
    assert answers_sync(put(damaged_images(careless)[name].image, tmp_path))


def test_a_refusal_that_ends_starts_nothing(tmp_path: Path) -> None:
    """The board restarts and refuses again, as the frame counters that stand still show."""
    once = [
        ("__attribute__((noreturn)) ", ""),
        ("period = 0u;; period++", "period = 0u; period < 1u; period++"),
    ]
    damaged = damaged_images(mutant(tmp_path / "tree", *once))["calibration damaged"]
    frames = [frame for _, frame in heard(put(damaged.image, tmp_path), periods=3)]
    assert frames == 3 * frames[: len(SPOKEN)]
    says_no_current_and_why(frames[: len(SPOKEN)], damaged.part, damaged.status)


@pytest.mark.parametrize("fault", ["undefined instruction", "stack overflow"])
def test_a_fault_of_the_processor_restarts_the_board(fault: str, tmp_path: Path) -> None:
    application, calibration = parts(image())
    (entry,) = struct.unpack_from("<I", application, VECTORS + 4)
    if fault == "stack overflow":
        application = patched(application, VECTORS, RAM.address + 8, entry)
    else:
        code = (entry & ~3) - APPLICATION.address
        application = patched(application, code, UNDEFINED, UNDEFINED)
    path, socket_path = put(with_parts(image(), application, calibration), tmp_path), tmp_path / "m"
    with (
        Emulation(path, BOARD, options=monitor_options(socket_path)),
        monitor(socket_path) as observer,
    ):
        observer.await_event("RESET")
