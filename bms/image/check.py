"""Checks of an image for a target: those of its boot stage, in the same C code, and a few more."""

from __future__ import annotations

from bms.errors import InputError
from bms.firmware.image_checks import (
    IMAGE_OK,
    ImagePart,
    application_status,
    boot_status,
    calibration_status,
    floor_status,
)
from bms.firmware.image_header import Header
from bms.image.floor import FLOOR_LENGTH
from bms.image.making import make_command, port_name
from bms.image.memory_map import ERASED, MEMORY_MAP, TARGETS, Region
from bms.image.parts import calibration_of

REASONS = {
    "IMAGE_NO_MAGIC": "is missing, truncated or of another kind",
    "IMAGE_WRONG_LENGTH": "is truncated, or its length damaged",
    "IMAGE_WRONG_CRC": "is damaged (CRC-32)",
    "IMAGE_WRONG_HEADER_LAYOUT": "has a header of another layout",
    "IMAGE_WRONG_TARGET": "is for another board than this target",
    "IMAGE_WRONG_VECTORS": "starts outside of its place",
    "IMAGE_WRONG_CALIBRATION_LAYOUT": "has another layout than the application was built for",
    "IMAGE_WRONG_FIRMWARE_VERSION": "is for another firmware version",
    "IMAGE_WRONG_CONTENT": "has a header that is not its own",
    "IMAGE_WRONG_HASH": "was edited after it had been made (SHA-256)",
    "IMAGE_ROLLED_BACK": "is older than the firmware that this board has had",
    "IMAGE_WRONG_FLOOR": "has a damaged record of the oldest version that the board takes",
    "IMAGE_REPEATED_FAULTS": "has restarted by processor faults again and again",
    "IMAGE_REPEATED_WATCHDOG": "has hung again and again",
    "IMAGE_REPEATED_RESETS": "has been reset again and again",
}
_NEWER = "give a newer one, or take this one by 'bms flash --allow-older'"
_EXPORT = "make it with 'bms export --preset PRESET --model model.json --out out/export'"


def check_image(image: bytes, target: str, origin: str) -> None:
    """Raise InputError, naming the origin, unless the target's boot stage would start this image.

    Bytes that belong to no part must be erased, so that no flipped bit passes.
    """
    check_application(image, target, origin)
    check_calibration(calibration_of(image), image, origin)


def check_application(image: bytes, target: str, origin: str) -> None:
    """Raise InputError, naming the origin, unless boot stage and application fit the target.

    What stands in the place of the calibration is not looked at.
    """
    boot, application = MEMORY_MAP.boot, MEMORY_MAP.application
    remedy = f"make it with '{make_command(port_name(target))}'"
    if len(image) < application.end:
        raise InputError(
            f"{origin}: {len(image)} bytes are no whole image; {remedy}, and give a calibration "
            "part by --calibration"
        )
    _require(boot_status(_part(image, boot)), origin, "boot stage", remedy)
    ram = MEMORY_MAP.ram
    status = application_status(_part(image, application), TARGETS[target], ram.address, ram.length)
    _require(status, origin, "application", remedy)
    header = Header.parse(image[application.address :])
    floor = MEMORY_MAP.floor
    _require(floor_status(_part(image, floor), header.pack()), origin, "application", _NEWER)
    gap = (
        image[floor.address + FLOOR_LENGTH : floor.end]
        + image[application.address + header.length : application.end]
    )
    if gap.strip(bytes([ERASED])):
        raise InputError(f"{origin}: bytes between the parts are not erased; {remedy}")


def check_calibration(part: bytes, image: bytes, origin: str) -> None:
    """Raise InputError, naming the origin, unless the part fits the application of the image."""
    calibration = ImagePart(part, MEMORY_MAP.calibration.address)
    status = calibration_status(calibration, image[MEMORY_MAP.application.address :])
    _require(status, origin, "calibration", _EXPORT)
    if len(part) != Header.parse(part).length:
        raise InputError(f"{origin}: calibration has bytes behind its end; {_EXPORT}")


def _part(image: bytes, region: Region) -> ImagePart:
    return ImagePart(image[region.address : region.end], region.address)


def _require(status: str, origin: str, part: str, remedy: str) -> None:
    if status != IMAGE_OK:
        raise InputError(f"{origin}: {part} {REASONS[status]}; {remedy}")
