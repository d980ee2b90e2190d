"""Identifiers of the frames that begin a control period."""

SYNC_ID = 0x080
"""Start of a control period in lock step (CiA 301)."""
MEASUREMENT_ID = 0x100
"""CellElectrical, with which the plant begins a period."""
