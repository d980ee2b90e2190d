"""The calibration part of an image: made from a preset and a model, taken out, put in."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

from bms.firmware.calibration import calibration_bytes, calibration_hashes
from bms.firmware.image_header import (
    ANY_TARGET,
    CALIBRATION_LAYOUT,
    CALIBRATION_MAGIC,
    FIRMWARE_VERSION,
    HEADER_LAYOUT,
    HEADER_LENGTH,
    LONGEST_CALIBRATION,
    Header,
)
from bms.image.memory_map import ERASED, MEMORY_MAP
from bms.image.seal import content_hashes, sealed_part
from bms.model.model_file import KanModel
from bms.presets import Preset


def calibration_part(preset: Preset, model: KanModel) -> bytes:
    """Header and calibration block for the firmware of this version.

    Raises ModelMismatchError for a stale pair and InputError when the firmware refuses the block.
    """
    content = calibration_bytes(preset, model)
    model_hash, preset_hash = calibration_hashes(content)
    header = Header(
        magic=CALIBRATION_MAGIC,
        crc32=0,
        length=HEADER_LENGTH + len(content),
        header_layout=HEADER_LAYOUT,
        target=ANY_TARGET,
        firmware_version=FIRMWARE_VERSION,
        calibration_layout=CALIBRATION_LAYOUT,
        calibration_length=LONGEST_CALIBRATION,
        model_hash=model_hash,
        preset_hash=preset_hash,
        content_hash=0,
        content_hash_rest=0,
    )
    return sealed_part(header.pack() + content, model_hash, preset_hash)


def calibration_content(preset: Preset, model: KanModel) -> int:
    """CalibrationContent of an ECU whose calibration is the one that these two make.

    First 32 bits of the SHA-256 of its bytes. Raises what calibration_part raises.
    """
    return _content_of(_Pair((preset.hash, model.hash), preset, model))


@dataclass(frozen=True)
class _Pair:
    """A preset and a model, equal where their hashes are, which are of all that they hold."""

    hashes: tuple[str, str]
    preset: Preset = field(compare=False)
    model: KanModel = field(compare=False)


@lru_cache(maxsize=16)
def _content_of(pair: _Pair) -> int:
    """Every run asks for it, and a family's block takes a third of a second to make."""
    return content_hashes(calibration_bytes(pair.preset, pair.model))[0]


def calibration_of(image: bytes) -> bytes:
    """The calibration part of a checked image."""
    return image[MEMORY_MAP.calibration.address :]


def with_calibration(image: bytes, part: bytes) -> bytes:
    """The image with another calibration part; neither is checked."""
    start = MEMORY_MAP.calibration.address
    return image[:start].ljust(start, bytes([ERASED])) + part
