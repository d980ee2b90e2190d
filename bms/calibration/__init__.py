"""The firmware's calibration block: what of preset and model the C core is told."""

from bms.calibration.calibration_block import NO_CHANGES, calibration_fields

__all__ = ["NO_CHANGES", "calibration_fields"]
