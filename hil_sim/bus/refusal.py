"""Why the boot stage of an image does not start the application, as it says on the bus."""

from __future__ import annotations

from bms.firmware.image_checks import IMAGE_STATUS_NAMES

_PARTS = {1: "application", 2: "calibration", 3: "boot stage"}
_PART_FACTOR = 256


def refusal_text(model_hash: int) -> str:
    """In words, by the model hash of an Identity with firmware version 0.

    See firmware_c/boot/refusal.h.
    """
    part, status = divmod(model_hash, _PART_FACTOR)
    check = (
        IMAGE_STATUS_NAMES.get(status, f"check {status}")
        .removeprefix("IMAGE_")
        .lower()
        .replace("_", " ")
    )
    return f"its boot stage refuses the {_PARTS.get(part, f'part {part}')} ({check}); flash it anew"
