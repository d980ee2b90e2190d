"""Fills in what a linker cannot know: checksums and hashes."""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import replace

from bms.firmware.calibration import calibration_hashes
from bms.firmware.image_header import CRC_COVERS_FROM, HEADER_LENGTH, Header
from bms.image.memory_map import MEMORY_MAP

_CRC_LENGTH = 4


def sealed_part(part: bytes, model_hash: int, preset_hash: int) -> bytes:
    """A part of which all but CRC and hashes is right, with these filled in."""
    content_hash, rest = content_hashes(part[HEADER_LENGTH:])
    header = replace(
        Header.parse(part),
        model_hash=model_hash,
        preset_hash=preset_hash,
        content_hash=content_hash,
        content_hash_rest=rest,
    )
    content = header.pack()[CRC_COVERS_FROM:] + part[HEADER_LENGTH:]
    return replace(header, crc32=zlib.crc32(content)).pack() + part[HEADER_LENGTH:]


def content_hashes(content: bytes) -> tuple[int, int]:
    """First two words of the SHA-256 of what follows a header, as the header holds them."""
    digest = hashlib.sha256(content).digest()
    return int.from_bytes(digest[:4], "big"), int.from_bytes(digest[4:8], "big")


def sealed_boot(boot: bytes) -> bytes:
    """The boot stage with the CRC-32 of all other bytes as its last word."""
    content = boot[:-_CRC_LENGTH]
    return content + zlib.crc32(content).to_bytes(_CRC_LENGTH, "little")


def sealed_headers(image: bytes) -> dict[str, bytes]:
    """Section name -> header of both parts of a linked image."""
    places = {
        "application_header": MEMORY_MAP.application.address,
        "calibration_header": MEMORY_MAP.calibration.address,
    }
    hashes = calibration_hashes(image[places["calibration_header"] + HEADER_LENGTH :])
    headers = {}
    for name, start in places.items():
        length = Header.parse(image[start:]).length
        part = sealed_part(image[start : start + length], *hashes)
        headers[name] = part[:HEADER_LENGTH]
    return headers
