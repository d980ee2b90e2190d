"""Flash images: their memory map, headers, checks, and the parts that can be replaced."""

from bms.firmware.image_header import Header
from bms.image.check import check_application, check_calibration, check_image
from bms.image.making import make_command, port_name
from bms.image.memory_map import MEMORY_MAP, TARGETS
from bms.image.parts import calibration_of, calibration_part, with_calibration

__all__ = [
    "MEMORY_MAP",
    "TARGETS",
    "Header",
    "calibration_of",
    "calibration_part",
    "check_application",
    "check_calibration",
    "check_image",
    "make_command",
    "port_name",
    "with_calibration",
]
