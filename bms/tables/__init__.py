"""What goes from Python into the firmware: network tables and the calibration block."""

from bms.tables.calibration_block import NO_CHANGES, calibration_fields, check_pair
from bms.tables.network_tables import NetworkTables, network_tables

__all__ = [
    "NO_CHANGES",
    "NetworkTables",
    "calibration_fields",
    "check_pair",
    "network_tables",
]
