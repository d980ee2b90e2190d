"""Presets: one TOML file each with cell, limits, gains, uncertainty, timing and sensors."""

from bms.presets.loader import (
    DEFAULT_PRESET,
    load_preset,
    one_cell_preset_names,
    preset_names,
    preset_path,
)
from bms.presets.schema import Preset

__all__ = [
    "DEFAULT_PRESET",
    "Preset",
    "load_preset",
    "one_cell_preset_names",
    "preset_names",
    "preset_path",
]
