"""The calibration part of an image: made from a preset and a model, taken out, put in."""

from __future__ import annotations

from bms.firmware._firmware import ffi, lib
from bms.firmware.calibration import calibration_block
from bms.image.header import CALIBRATION, HEADER_LENGTH, Header
from bms.image.memory_map import ERASED, MEMORY_MAP
from bms.image.seal import sealed_part
from bms.model.model_file import KanModel
from bms.presets import Preset


def calibration_part(preset: Preset, model: KanModel) -> bytes:
    """Header and calibration block for the firmware of this version.

    Raises ModelMismatchError for a stale pair and InputError when the firmware refuses the block.
    """
    block = calibration_block(preset, model, compiled_in=False)
    content = bytes(ffi.buffer(block))
    length = HEADER_LENGTH + len(content)
    header = Header(
        magic=CALIBRATION,
        crc32=0,
        length=length,
        header_layout=lib.IMAGE_HEADER_LAYOUT,
        target=lib.IMAGE_ANY_TARGET,
        firmware_version=lib.BMS_FIRMWARE_VERSION,
        calibration_layout=lib.BMS_CALIBRATION_LAYOUT,
        calibration_length=length,
        model_hash=block.model_hash,
        preset_hash=block.preset_hash,
    )
    return sealed_part(header.pack() + content, block.model_hash, block.preset_hash)


def calibration_of(image: bytes) -> bytes:
    """The calibration part of a checked image."""
    return image[MEMORY_MAP.calibration.address :]


def with_calibration(image: bytes, part: bytes) -> bytes:
    """The image with another calibration part; neither is checked."""
    start = MEMORY_MAP.calibration.address
    return image[:start].ljust(start, bytes([ERASED])) + part
