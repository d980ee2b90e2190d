"""Whether a target may be given an image: by the code that its boot stage runs, and then some."""

from __future__ import annotations

from typing import Any

from bms.errors import InputError
from bms.firmware._firmware import ffi, lib
from bms.image.header import HEADER_LENGTH, Header
from bms.image.memory_map import ERASED, MEMORY_MAP, TARGETS, Region
from bms.image.parts import calibration_of

_REASONS = {
    lib.IMAGE_NO_MAGIC: "is missing, truncated or of another kind",
    lib.IMAGE_WRONG_LENGTH: "is truncated, or its length damaged",
    lib.IMAGE_WRONG_CRC: "is damaged (CRC-32)",
    lib.IMAGE_WRONG_HEADER_LAYOUT: "has a header of another layout",
    lib.IMAGE_WRONG_TARGET: "is for another board than this target",
    lib.IMAGE_WRONG_VECTORS: "starts outside of its place",
    lib.IMAGE_WRONG_CALIBRATION_LAYOUT: "has another layout than the application was built for",
    lib.IMAGE_WRONG_FIRMWARE_VERSION: "is for another firmware version",
    lib.IMAGE_WRONG_CONTENT: "has a header that is not its own",
}
_BUILD = "make it with 'make firmware'"
_EXPORT = "make it with 'bms export'"


def check_image(image: bytes, target: str, origin: str) -> None:
    """Raise InputError, naming the origin, unless the target's boot stage would start this image.

    Bytes that belong to no part must be erased, so that no flipped bit passes.
    """
    check_application(image, target, origin)
    check_calibration(calibration_of(image), image, origin)


def check_application(image: bytes, target: str, origin: str) -> None:
    """As check_image, whatever stands in the place of the calibration."""
    boot, application = MEMORY_MAP.boot, MEMORY_MAP.application
    if len(image) < application.end:
        raise InputError(
            f"{origin}: {len(image)} bytes are no whole image; {_BUILD}, and give a calibration "
            "part by --calibration"
        )
    boot_memory, application_memory = _memory(image, boot), _memory(image, application)
    status = lib.image_check_boot(boot_memory.place)
    _require(status, origin, "boot stage", _BUILD)
    ram = ffi.new("image_memory_t *", {"address": MEMORY_MAP.ram.address})
    ram.length = MEMORY_MAP.ram.length
    status = lib.image_check_application(application_memory.place, TARGETS[target], ram)
    _require(status, origin, "application", _BUILD)
    header = Header.parse(image[application.address :])
    gap = image[application.address + header.length : application.end]
    if gap.strip(bytes([ERASED])):
        raise InputError(f"{origin}: bytes between the parts are not erased; {_BUILD}")


def check_calibration(part: bytes, image: bytes, origin: str) -> None:
    """Raise InputError, naming the origin, unless the part fits the application of the image."""
    application = ffi.from_buffer(
        "image_header_t *", image[MEMORY_MAP.application.address :][:HEADER_LENGTH]
    )
    memory = _Memory(part, MEMORY_MAP.calibration.address)
    status = lib.image_check_calibration(memory.place, application)
    _require(status, origin, "calibration", _EXPORT)
    if len(part) != Header.parse(part).length:
        raise InputError(f"{origin}: calibration has bytes behind its end; {_EXPORT}")


class _Memory:
    """Bytes of the image where the C code may read them, aligned as on the target.

    `place` points into this object and is good as long as it is.
    """

    def __init__(self, content: bytes, address: int) -> None:
        self._words = ffi.new("uint64_t[]", (len(content) + 7) // 8)
        ffi.memmove(self._words, content, len(content))
        self.place: Any = ffi.new(
            "image_memory_t *",
            {
                "bytes": ffi.cast("uint8_t *", self._words),
                "address": address,
                "length": len(content),
            },
        )


def _memory(image: bytes, region: Region) -> _Memory:
    return _Memory(image[region.address : region.end], region.address)


def _require(status: int, origin: str, part: str, remedy: str) -> None:
    if status != lib.IMAGE_OK:
        raise InputError(f"{origin}: {part} {_REASONS[status]}; {remedy}")
