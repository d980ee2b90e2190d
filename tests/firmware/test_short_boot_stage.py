"""A boot stage that is too short to hold its own CRC."""

from __future__ import annotations

import pytest

from bms.firmware.image_checks import IMAGE_OK, ImagePart, boot_status


@pytest.mark.parametrize("length", range(4))
def test_what_has_no_room_for_a_crc_is_refused(length: int) -> None:
    """Its length less that of the CRC would be four thousand million bytes."""
    assert boot_status(ImagePart(b"\xff" * length, 0)) == "IMAGE_WRONG_LENGTH"


def test_four_bytes_are_enough_for_the_crc_of_nothing() -> None:
    assert boot_status(ImagePart(bytes(4), 0)) == IMAGE_OK
    assert boot_status(ImagePart(b"\0\0\0\1", 0)) == "IMAGE_WRONG_CRC"
