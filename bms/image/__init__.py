"""Flash images: their memory map, headers, checks, and the parts that can be replaced."""

from bms.firmware.image_header import Header
from bms.image.check import check_application, check_calibration, check_image
from bms.image.floor import floor_of, with_floor
from bms.image.making import make_command, port_name
from bms.image.memory_map import MEMORY_MAP, TARGETS
from bms.image.parts import (
    calibration_content,
    calibration_of,
    calibration_part,
    with_calibration,
)
from bms.image.shipped import UNKNOWN_CONTENT, content_text, foreign_content, shipped_contents

__all__ = [
    "MEMORY_MAP",
    "TARGETS",
    "UNKNOWN_CONTENT",
    "Header",
    "calibration_content",
    "calibration_of",
    "calibration_part",
    "check_application",
    "check_calibration",
    "check_image",
    "content_text",
    "floor_of",
    "foreign_content",
    "make_command",
    "port_name",
    "shipped_contents",
    "with_calibration",
    "with_floor",
]
