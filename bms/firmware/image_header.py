"""The header of a part of an image, as firmware_c/image/image.h lays it out."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from bms.firmware._firmware import ffi, lib

HEADER_LENGTH: int = ffi.sizeof("image_header_t")
CRC_COVERS_FROM: int = ffi.offsetof("image_header_t", "length")

APPLICATION_MAGIC: int = lib.IMAGE_MAGIC_APPLICATION
CALIBRATION_MAGIC: int = lib.IMAGE_MAGIC_CALIBRATION
HEADER_LAYOUT: int = lib.IMAGE_HEADER_LAYOUT
ANY_TARGET: int = lib.IMAGE_ANY_TARGET
FIRMWARE_VERSION: int = lib.BMS_FIRMWARE_VERSION
CALIBRATION_LAYOUT: int = lib.BMS_CALIBRATION_LAYOUT
LONGEST_CALIBRATION: int = HEADER_LENGTH + ffi.sizeof("bms_calibration_t")


@dataclass(frozen=True)
class Header:
    """Fields as in the C structure; lengths in bytes."""

    magic: int
    crc32: int
    length: int
    header_layout: int
    target: int
    firmware_version: int
    calibration_layout: int
    calibration_length: int
    model_hash: int
    preset_hash: int
    content_hash: int
    content_hash_rest: int

    @classmethod
    def parse(cls, data: bytes) -> Header:
        """Header at the start of a part, whatever it says; ValueError when the part is shorter."""
        if len(data) < HEADER_LENGTH:
            raise ValueError(f"a header has {HEADER_LENGTH} bytes, not {len(data)}")
        fields = ffi.from_buffer("image_header_t *", data[:HEADER_LENGTH])
        return cls(**{name: getattr(fields, name) for name in cls.__dataclass_fields__})

    def pack(self) -> bytes:
        """The bytes in flash."""
        return bytes(ffi.buffer(ffi.new("image_header_t *", asdict(self))))
