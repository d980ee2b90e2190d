"""Images that must not be started, each with the part and the check that have to refuse it."""

from __future__ import annotations

import hashlib
import struct
import zlib
from dataclasses import dataclass, replace
from typing import Any

from bms.image import MEMORY_MAP, TARGETS, Header, with_floor

BOARD = "mps2-an386"
HEADER_LENGTH, CRC_COVERS_FROM, VECTORS = 48, 8, 128
BOOT, APPLICATION, CALIBRATION = MEMORY_MAP.boot, MEMORY_MAP.application, MEMORY_MAP.calibration
FLOOR = MEMORY_MAP.floor
RAM = MEMORY_MAP.ram


def resealed(part: bytes, **changes: int) -> bytes:
    """The part with other header fields, and a CRC and a hash that fit."""
    end = changes.get("length", Header.parse(part).length)
    digest = hashlib.sha256(part[HEADER_LENGTH:end]).digest()
    high, low = struct.unpack_from(">2I", digest)
    return recounted(part, content_hash=high, content_hash_rest=low, **changes)


def recounted(part: bytes, **changes: int) -> bytes:
    """The part with other header fields and a CRC that fits, whatever its hash says."""
    header = replace(Header.parse(part), **changes)
    content = header.pack()[CRC_COVERS_FROM:] + part[HEADER_LENGTH:]
    return replace(header, crc32=zlib.crc32(content)).pack() + part[HEADER_LENGTH:]


def patched(part: bytes, offset: int, *words: int) -> bytes:
    """The part with other words at an offset, and a CRC and a hash that fit."""
    new = struct.pack(f"<{len(words)}I", *words)
    return resealed(part[:offset] + new + part[offset + len(new) :])


def edited(part: bytes, offset: int) -> bytes:
    """The part with another byte, and a CRC that somebody has redone."""
    return recounted(flipped(part, 8 * offset))


def flipped(image: bytes, bit: int) -> bytes:
    """The image with one bit changed."""
    changed = bytearray(image)
    changed[bit // 8] ^= 1 << (bit % 8)
    return bytes(changed)


def parts(image: bytes) -> tuple[bytes, bytes]:
    """Application and calibration of a whole image, without the erased room behind them."""
    application = image[APPLICATION.address :]
    return application[: Header.parse(application).length], image[CALIBRATION.address :]


def with_parts(image: bytes, application: bytes, calibration: bytes) -> bytes:
    """The image with other parts."""
    boot = image[: APPLICATION.address]
    return boot + application.ljust(APPLICATION.length, b"\xff") + calibration


@dataclass(frozen=True)
class Damaged:
    """An image, and who refuses it: a part as in refusal_part_t, a check as in image_status_t."""

    image: bytes
    part: str
    status: str


def damaged_images(image: bytes) -> dict[str, Damaged]:
    """One for each thing that the boot stage checks, all but those for the CRC well sealed."""
    application, calibration = parts(image)
    start = APPLICATION.address

    def bad_application(status: str, part: bytes) -> Damaged:
        return Damaged(with_parts(image, part, calibration), "APPLICATION", status)

    def bad_calibration(status: str, part: bytes) -> Damaged:
        return Damaged(with_parts(image, application, part), "CALIBRATION", status)

    def vectors(stack_top: int, first: int) -> Damaged:
        return bad_application("WRONG_VECTORS", patched(application, VECTORS, stack_top, first))

    top, entry = struct.unpack_from("<2I", application, VECTORS)
    end = start + len(application)
    layout = Header.parse(application).calibration_layout
    longest = Header.parse(application).calibration_length
    version = Header.parse(application).firmware_version
    swapped = with_parts(image, calibration, application)
    erased = bytes([0xFF])
    return {
        "boot stage with a flipped bit": Damaged(flipped(image, 8 * 3990), "BOOT", "WRONG_CRC"),
        "no application": bad_application("NO_MAGIC", b""),
        "calibration in the application's place": Damaged(swapped, "APPLICATION", "NO_MAGIC"),
        "application too long": bad_application(
            "WRONG_LENGTH", resealed(application, length=APPLICATION.length + 4)
        ),
        "application too short": bad_application(
            "WRONG_LENGTH", resealed(application, length=VECTORS)
        ),
        "application of no length": bad_application(
            "WRONG_LENGTH", resealed(application, length=0)
        ),
        "length before CRC": bad_application(
            "WRONG_LENGTH", flipped(resealed(application, length=APPLICATION.length + 4), 8 * 50)
        ),
        "application truncated": bad_application("WRONG_CRC", application[:-4]),
        "application damaged": bad_application("WRONG_CRC", flipped(application, 8 * 300)),
        "last byte damaged": bad_application(
            "WRONG_CRC", flipped(application, 8 * len(application) - 1)
        ),
        "CRC before layout": bad_application(
            "WRONG_CRC", flipped(resealed(application, header_layout=9), 8 * 300)
        ),
        "header of another layout": bad_application(
            "WRONG_HEADER_LAYOUT", resealed(application, header_layout=1)
        ),
        "another board": bad_application(
            "WRONG_TARGET", resealed(application, target=TARGETS["mps2-an385"])
        ),
        "stack below RAM": vectors(RAM.address, entry),
        "stack above RAM": vectors(RAM.end + 8, entry),
        "stack not aligned": vectors(top - 4, entry),
        "start in the boot stage": vectors(top, 0x101),
        "start in the header": vectors(top, start + VECTORS - 1),
        "start behind the application": vectors(top, end + 1),
        "start not in Thumb code": vectors(top, entry - 1),
        "application edited": bad_application("WRONG_HASH", edited(application, 400)),
        "calibration edited": bad_calibration("WRONG_HASH", edited(calibration, 500)),
        "first half of the hash": bad_calibration(
            "WRONG_HASH", recounted(calibration, content_hash=1)
        ),
        "second half of the hash": bad_calibration(
            "WRONG_HASH", recounted(calibration, content_hash_rest=1)
        ),
        "older than the floor": Damaged(
            with_floor(image, version + 1), "APPLICATION", "ROLLED_BACK"
        ),
        "floor damaged": Damaged(
            flipped(with_floor(image, version), 8 * FLOOR.address), "APPLICATION", "WRONG_FLOOR"
        ),
        "floor half erased": Damaged(
            flipped(image, 8 * (FLOOR.address + 4)), "APPLICATION", "WRONG_FLOOR"
        ),
        "no calibration": bad_calibration("NO_MAGIC", erased * len(calibration)),
        "calibration missing": bad_calibration("NO_MAGIC", b""),
        "application in the calibration's place": bad_calibration("NO_MAGIC", application[:3000]),
        "calibration truncated": bad_calibration("WRONG_CRC", calibration[:-4]),
        "calibration too short": bad_calibration(
            "WRONG_LENGTH", resealed(calibration, length=HEADER_LENGTH)
        ),
        "calibration shorter than any model": bad_calibration(
            "WRONG_LENGTH", resealed(calibration[:900], length=900)
        ),
        "calibration shorter than its model": bad_calibration(
            "WRONG_CONTENT", resealed(calibration[:-4], length=len(calibration) - 4)
        ),
        "calibration longer than its model": bad_calibration(
            "WRONG_CONTENT", resealed(calibration + bytes(4), length=len(calibration) + 4)
        ),
        "calibration damaged": bad_calibration("WRONG_CRC", flipped(calibration, 8 * 500)),
        "calibration header of another layout": bad_calibration(
            "WRONG_HEADER_LAYOUT", resealed(calibration, header_layout=1)
        ),
        "calibration of another layout": bad_calibration(
            "WRONG_CALIBRATION_LAYOUT", resealed(calibration, calibration_layout=layout - 1)
        ),
        "application for another layout": Damaged(
            with_parts(image, resealed(application, calibration_layout=layout + 1), calibration),
            "CALIBRATION",
            "WRONG_CALIBRATION_LAYOUT",
        ),
        "calibration of another length": Damaged(
            with_parts(image, resealed(application, calibration_length=longest + 8), calibration),
            "CALIBRATION",
            "WRONG_CALIBRATION_LAYOUT",
        ),
        "calibration for an older firmware": bad_calibration(
            "WRONG_FIRMWARE_VERSION", resealed(calibration, firmware_version=version - 1)
        ),
        "calibration that names another model": bad_calibration(
            "WRONG_CONTENT", resealed(calibration, model_hash=1)
        ),
        "calibration that names another preset": bad_calibration(
            "WRONG_CONTENT", resealed(calibration, preset_hash=1)
        ),
        "block of another layout": bad_calibration(
            "WRONG_CONTENT", patched(calibration, HEADER_LENGTH, layout + 1)
        ),
        "block of an older layout": bad_calibration(
            "WRONG_CONTENT", patched(calibration, HEADER_LENGTH, layout - 1)
        ),
    }


class BootStage:
    """The checks of the boot stage in its order, by the functions of a library built from it."""

    def __init__(self, ffi: Any, lib: Any) -> None:
        self._ffi, self._lib = ffi, lib
        self._ram = ffi.new("image_memory_t *", {"address": RAM.address, "length": RAM.length})

    def verdict(self, image: bytes) -> tuple[str, str]:
        """("", "OK"), or part and check that refuse the image."""
        lib = self._lib
        status = lib.image_check_boot(self._place(image, BOOT.address, BOOT.length))
        if status != lib.IMAGE_OK:
            return "BOOT", self._name(status)
        application = self._place(image, APPLICATION.address, APPLICATION.length)
        status = lib.image_check_application(application, TARGETS[BOARD], self._ram)
        if status != lib.IMAGE_OK:
            return "APPLICATION", self._name(status)
        header = self._ffi.cast("image_header_t *", application.bytes)
        floor = self._place(image, FLOOR.address, FLOOR.length)
        status = lib.image_check_floor(floor, header)
        if status != lib.IMAGE_OK:
            return "APPLICATION", self._name(status)
        calibration = self._place(image, CALIBRATION.address, CALIBRATION.length)
        status = lib.image_check_calibration(calibration, header)
        return ("", "OK") if status == lib.IMAGE_OK else ("CALIBRATION", self._name(status))

    def calibration_status_at(self, address: int, length: int, header: bytes) -> int:
        """What a calibration in memory of this process is for the application of the header."""
        ffi = self._ffi
        place = ffi.new("image_memory_t *", {"length": length})
        place.bytes = ffi.cast("uint8_t *", address)
        of = ffi.from_buffer("image_header_t *", header)
        return int(self._lib.image_check_calibration(place, of))

    def _name(self, status: int) -> str:
        names = self._ffi.typeof("image_status_t").elements
        return str(names[status]).removeprefix("IMAGE_")

    def _place(self, image: bytes, address: int, length: int) -> Any:
        """Flash of the target, erased where the image has nothing."""
        content = image[address : address + length].ljust(length, b"\xff")
        self._memory = [
            *getattr(self, "_memory", ()),
            self._ffi.new("uint64_t[]", length // 8 + 1),
        ][-4:]
        self._ffi.memmove(self._memory[-1], content, length)
        fields = {"address": address, "length": length}
        place = self._ffi.new("image_memory_t *", fields)
        place.bytes = self._ffi.cast("uint8_t *", self._memory[-1])
        return place
