"""What `bms flash` and the boot stage make of edited calibrations and of older firmware."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bms.errors import InputError
from bms.firmware.image_header import FIRMWARE_VERSION
from bms.image import MEMORY_MAP, calibration_content, calibration_of, floor_of, with_floor
from bms.model.pair import load_pair
from bms.presets import DEFAULT_PRESET
from hil_sim.bus.buses import Frame, open_bus
from hil_sim.bus.database import load_codecs
from hil_sim.targets import Emulation, Flash
from tests.firmware.damaged_images import BOARD, parts, patched, resealed, with_parts
from tests.firmware.ports import image, needs_emulator

pytestmark = needs_emulator

CODECS = load_codecs()
REFERENCE_CURRENT = 48 + 16  # of the image's header, then of bms_calibration_t
A_LITTLE_MORE = 0xC1A00000
ANSWER_TIMEOUT_S = 10.0


def version(content: bytes, number: int) -> bytes:
    """The image, well made, with another firmware version."""
    application, calibration = parts(content)
    changes = {"firmware_version": number}
    return with_parts(content, resealed(application, **changes), resealed(calibration, **changes))


def put(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


@pytest.fixture
def edited(tmp_path: Path) -> Path:
    """An image with an edited calibration of which even the hash is redone."""
    application, calibration = parts(image())
    content = patched(calibration, REFERENCE_CURRENT, A_LITTLE_MORE)
    assert content != calibration
    return put(tmp_path / "edited.bin", with_parts(image(), application, content))


def test_an_edited_calibration_with_everything_redone_is_refused_by_the_host(
    edited: Path, tmp_path: Path
) -> None:
    flash = Flash(tmp_path / "flash.bin", BOARD)
    with pytest.raises(InputError, match="not what its model and preset make") as refusal:
        flash.program(edited)
    assert "\n" not in str(refusal.value) and "bms export" in str(refusal.value)
    assert not flash.path.exists()


def test_a_board_says_the_content_of_its_flash(edited: Path) -> None:
    """And so no charge begins with an edited one, past `bms flash`, though its hashes are right."""
    with Emulation(edited, BOARD) as board, open_bus(board.bus) as bus:
        bus.send(Frame(CODECS["SYNC"].frame_id, b""))
        said: dict[str, Any] = {}
        while "CommandState" not in said:
            frame = bus.receive(ANSWER_TIMEOUT_S)
            assert frame is not None
            codec = next(c for c in CODECS.values() if c.frame_id == frame.frame_id)
            said |= codec.decode(frame.data) or {}
    preset, model = load_pair(DEFAULT_PRESET, None)
    assert said["ModelHash"] == int(model.hash[:8], 16), "the edit is not seen there"
    content = int.from_bytes(calibration_of(edited.read_bytes())[40:44], "little")
    assert said["CalibrationContent"] == content != calibration_content(preset, model)
    assert (said["ResetCause"], said["ResetCount"]) == (0, 0)


def test_no_charge_begins_with_an_edited_calibration(bms: Any, edited: Path) -> None:
    with Emulation(edited, BOARD) as board:
        code, _, error = bms("plant", "--bus", board.bus, "--max-time-s", 3)
    assert code == 2 and len(error.splitlines()) == 1
    assert "not what its model and preset make" in error


def test_older_firmware_is_taken_only_when_asked_for(tmp_path: Path) -> None:
    flash = Flash(tmp_path / "flash.bin", BOARD)
    newer = put(tmp_path / "newer.bin", version(image(), FIRMWARE_VERSION + 1))
    present = put(tmp_path / "present.bin", image())
    flash.program(present)
    flash.program(newer)
    before = flash.path.read_bytes()
    assert floor_of(before) == FIRMWARE_VERSION + 1
    with pytest.raises(InputError, match=r"older than the firmware.*--allow-older"):
        flash.program(present)
    assert flash.path.read_bytes() == before
    flash.program(present, allow_older=True)
    assert floor_of(flash.path.read_bytes()) == FIRMWARE_VERSION
    flash.headers()


def test_the_option_of_the_command(bms: Any, tmp_path: Path) -> None:
    path = put(tmp_path / "flash.bin", with_floor(image(), FIRMWARE_VERSION + 1))
    command = ["flash", "--image", put(tmp_path / "i.bin", image()), "--flash", path, "--no-start"]
    code, out, error = bms(*command)
    assert (code, out) == (2, "") and "older than the firmware" in error
    assert bms(*command, "--allow-older")[0] == 0


def test_a_board_whose_floor_is_damaged_takes_no_image_unasked(tmp_path: Path) -> None:
    present = put(tmp_path / "present.bin", image())
    flash = Flash(tmp_path / "flash.bin", BOARD)
    flash.program(present)
    damaged = bytearray(flash.path.read_bytes())
    damaged[MEMORY_MAP.floor.address] ^= 1
    put(flash.path, bytes(damaged))
    with pytest.raises(InputError, match="--allow-older"):
        flash.program(present)
    flash.program(present, allow_older=True)
