"""The boot stage's checks of an image (firmware_c/image/image.h) as Python calls.

Each says what it finds by the name that the C code gives it, "IMAGE_OK" when there is no fault.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from bms.firmware._firmware import ffi, lib
from bms.firmware.image_header import HEADER_LENGTH

IMAGE_OK = "IMAGE_OK"
IMAGE_STATUS_NAMES: Mapping[int, str] = MappingProxyType(ffi.typeof("image_status_t").elements)
"""Every finding: its number, as a boot stage sends it, and its name."""


class ImagePart:
    """Bytes of an image where the C code may read them, aligned as on the target.

    `memory` is an image_memory_t that points into this object and is good as long as it is.
    """

    def __init__(self, content: bytes, address: int) -> None:
        # As in flash, there is memory behind a part that is shorter than what its header is for.
        room = max(len(content), HEADER_LENGTH + ffi.sizeof("bms_calibration_t"))
        self._words = ffi.new("uint64_t[]", (room + 7) // 8)
        ffi.memmove(self._words, content, len(content))
        self.memory: Any = ffi.new(
            "image_memory_t *",
            {
                "bytes": ffi.cast("uint8_t *", self._words),
                "address": address,
                "length": len(content),
            },
        )


def boot_status(boot: ImagePart) -> str:
    """What is wrong with a boot stage."""
    return IMAGE_STATUS_NAMES[lib.image_check_boot(boot.memory)]


def application_status(
    application: ImagePart, target: int, ram_address: int, ram_length: int
) -> str:
    """What is wrong with an application for a target whose RAM is there."""
    ram = ffi.new("image_memory_t *", {"address": ram_address, "length": ram_length})
    return IMAGE_STATUS_NAMES[lib.image_check_application(application.memory, target, ram)]


def floor_status(floor: ImagePart, application_header: bytes) -> str:
    """What is wrong with the application that has this header for a board with this floor."""
    header = ffi.from_buffer("image_header_t *", application_header[:HEADER_LENGTH])
    return IMAGE_STATUS_NAMES[lib.image_check_floor(floor.memory, header)]


def calibration_status(calibration: ImagePart, application_header: bytes) -> str:
    """What is wrong with a calibration part for the application that has this header.

    Raises ValueError for fewer bytes than a header has.
    """
    if len(application_header) < HEADER_LENGTH:
        raise ValueError(f"a header has {HEADER_LENGTH} bytes, not {len(application_header)}")
    header = ffi.from_buffer("image_header_t *", application_header[:HEADER_LENGTH])
    return IMAGE_STATUS_NAMES[lib.image_check_calibration(calibration.memory, header)]
